"""Animations: the player in a notebook needs no network and draws each picture once."""

import re

import pytest
from sklearn_motionsync.display import SkeletonDisplay


@pytest.fixture(scope="module")
def player(bending):
    display = SkeletonDisplay.from_positions(bending.data[0], bending.skeleton)
    return display.animate(seconds=0.2, fps=10).to_jshtml()


def test_player_loads_nothing_from_a_network(player):
    assert not re.search(r"<link|@import|url\(|(src|href)=.https?:", player)


def test_every_button_has_an_icon_and_a_title(player):
    buttons = re.findall(r"<button ([^>]*)>(.*?)</button>", player, re.DOTALL)
    assert len(buttons) == 9
    assert all(re.search('title="[^"]+"', attributes) for attributes, _ in buttons)
    pictures = [picture.strip() for _, picture in buttons]
    assert all(re.fullmatch(r"<svg .*<path .*</svg>", p) for p in pictures), pictures
    assert len(set(pictures)) == 9


def test_saving_computes_the_layout_once_and_draws_each_picture_once(bending, tmp_path):
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
