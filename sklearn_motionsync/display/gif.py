"""A writer of GIF files with one palette for all pictures, which takes a fraction of the time."""

from io import BytesIO

import numpy as np

__all__ = ["gif_writer"]

# Colours of a GIF, and how many of them are the most frequent ones, which are exact.
_N_COLORS, _N_EXACT = 256, 32
# The number of pictures that the palette is chosen from.
_N_SAMPLED = 8
# The red, green and blue of a pixel.
_RGB = np.uint32(0xFFFFFF)


def gif_writer(fps, **options):
    """Matplotlib's writer of Pillow, with one palette for all pictures.

    Pillow chooses 256 colours for each picture, which takes longer than drawing. Here they are
    chosen once: the most frequent ones as they are, the others by median cut. Every colour that
    occurs becomes the nearest of them. Pictures with transparency are left to Pillow.

    Parameters
    ----------
    fps : float
    **options : dict
        Of the writer, such as ``metadata``.

    Returns
    -------
    PillowWriter
    """
    from matplotlib.animation import PillowWriter
    from PIL import Image

    class GifWriter(PillowWriter):
        """Keeps pictures as numbers of four bytes, and writes them at the end."""

        def setup(self, fig, outfile, dpi=None):
            super().setup(fig, outfile, dpi=dpi)
            self.pictures = []

        def grab_frame(self, **style):
            if {"dpi", "format", "bbox_inches"} & set(style):
                # Refuses them.
                super().grab_frame(**style)
            buffer = BytesIO()
            self.fig.savefig(buffer, format="rgba", dpi=self.dpi, **style)
            self.pictures.append(np.frombuffer(buffer.getbuffer(), dtype="<u4"))

        def finish(self):
            if not self.pictures:
                return
            if all(picture.min() >> 24 == 255 for picture in self.pictures):
                colors, numbers = indexed([picture & _RGB for picture in self.pictures])
                images = [
                    Image.frombuffer("P", self.frame_size, n, "raw", "P", 0, 1) for n in numbers
                ]
                for image in images:
                    image.putpalette(colors.tobytes())
            else:
                images = [
                    Image.frombuffer("RGBA", self.frame_size, picture, "raw", "RGBA", 0, 1)
                    for picture in self.pictures
                ]
            images[0].save(
                self.outfile,
                save_all=True,
                append_images=images[1:],
                duration=int(1000 / self.fps),
                loop=0,
            )

    return GifWriter(fps, **options)


def indexed(pictures):
    """A palette of pictures, ndarray of uint8 (n, 3), and the numbers of their colours in it.

    Parameters
    ----------
    pictures : list of ndarray of uint32, shape (n_pixels,)
        Red, green and blue from the lowest byte on.

    Returns
    -------
    colors : ndarray of uint8, shape (n_colors, 3)
    numbers : list of ndarray of uint8, shape (n_pixels,)
    """
    from scipy.spatial import KDTree

    colors = _palette(pictures)
    tree = KDTree(colors)
    # Pages of it that no colour needs take no memory.
    number_of = np.full(int(_RGB) + 1, -1, dtype=np.int16)
    out, before = [], None
    for picture in pictures:
        # Few pixels are not as in the picture before.
        changed = slice(None) if before is None else np.flatnonzero(picture != before)
        pixels = picture[changed]
        numbers_there = number_of[pixels]
        if numbers_there.size and numbers_there.min() < 0:
            new = np.unique(pixels[numbers_there < 0])
            number_of[new] = tree.query(_as_rgb(new))[1]
            numbers_there = number_of[pixels]
        numbers = np.zeros(len(picture), dtype=np.uint8) if before is None else out[-1].copy()
        numbers[changed] = numbers_there
        out.append(numbers)
        before = picture
    return colors, out


def _palette(pictures):
    """At most 256 colours of some of the pictures."""
    from PIL import Image

    sampled = pictures[:: -(-len(pictures) // _N_SAMPLED)]
    ground = sampled[0][0]
    # Most pixels are of the ground.
    drawn = np.concatenate([picture[picture != ground] for picture in sampled])
    colors, counts = np.unique(drawn, return_counts=True)
    order = np.argsort(-counts, kind="stable")
    exact_colors = order[: _N_COLORS - 1 if len(colors) < _N_COLORS else _N_EXACT - 1]
    exact = _as_rgb(np.concatenate([[ground], colors[exact_colors]]))
    mixed = np.delete(np.arange(len(colors)), exact_colors)
    if len(mixed) == 0:
        return exact
    # By their roots frequent colours count more, and rare ones still count.
    repeated = np.repeat(colors[mixed], np.ceil(np.sqrt(counts[mixed])).astype(int))
    chosen = Image.fromarray(_as_rgb(repeated)[np.newaxis]).quantize(
        _N_COLORS - _N_EXACT, method=Image.Quantize.MEDIANCUT
    )
    return np.concatenate([exact, np.reshape(chosen.getpalette(), (-1, 3)).astype(np.uint8)])


def _as_rgb(numbers):
    return np.stack([numbers & 255, numbers >> 8 & 255, numbers >> 16 & 255], -1).astype(np.uint8)
