"""Command-line arguments of the examples while the gallery runs them."""

from pathlib import Path


class GalleryArguments:
    """Figures that an example writes go under the build folder, not into the source tree."""

    def __repr__(self):
        return "GalleryArguments"

    def __call__(self, gallery_conf, script_vars):
        source = Path(script_vars["src_file"])
        if "--output" not in source.read_text(encoding="utf-8"):
            return []
        return ["--output", str(Path(gallery_conf["src_dir"]) / "_build" / "examples")]


gallery_arguments = GalleryArguments()
