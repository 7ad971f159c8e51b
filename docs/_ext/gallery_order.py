"""The order of the gallery: that of the names in examples/index.rst."""

from pathlib import Path

_INDEX = Path(__file__).parents[2] / "examples" / "index.rst"


class GalleryOrder:
    """A key that sorts the files of examples as the index names them."""

    def __repr__(self):
        return "GalleryOrder"

    def __call__(self, path):
        return _INDEX.read_text(encoding="utf-8").find(f"/{Path(path).name}")


gallery_order = GalleryOrder()
