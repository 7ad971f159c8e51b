"""Animations draw each picture once."""

import pytest
from sklearn_motionsync.display import SkeletonDisplay


def test_the_layout_is_computed_once_and_each_picture_drawn_once(bending, tmp_path):
    display = SkeletonDisplay.from_positions(bending.data[0], bending.skeleton)
    figure, drawn = display.figure_, []
    animation, layout = display.animate(seconds=1, fps=6), figure.get_layout_engine()
    figure.canvas.mpl_connect("draw_event", drawn.append)
    animation.save(tmp_path / "x.gif", "pillow", dpi=40)
    assert len(drawn) == 1 + 6
    assert figure.get_layout_engine() is layout
    with pytest.raises(ZeroDivisionError):
        animation.save(tmp_path / "x.gif", "pillow", progress_callback=lambda k, n: 1 / (2 - k))
    assert figure.get_layout_engine() is layout
    assert "draw_idle" not in vars(figure.canvas)
