"""What a notebook shows: links of the diagrams, short reprs, frames."""

import re

import pytest
from sklearn.pipeline import make_pipeline
from sklearn.utils import estimator_html_repr
from sklearn_motionsync import (
    ActionModel,
    ASpace,
    DenseSynchronizer,
    DirectionCosines,
    KeyframeSynchronizer,
    LinearSynchronizer,
    Skeleton,
)
from sklearn_motionsync.datasets import make_bending
from sklearn_motionsync.notebook import DOCUMENTATION

ESTIMATORS = [
    ActionModel(),
    ASpace(),
    DenseSynchronizer(),
    DirectionCosines(Skeleton.paper()),
    KeyframeSynchronizer(),
    LinearSynchronizer(),
]


@pytest.mark.parametrize("estimator", ESTIMATORS, ids=lambda e: type(e).__name__)
def test_diagrams_link_to_the_manual(estimator):
    page = f"{DOCUMENTATION}/reference/sklearn_motionsync.{type(estimator).__name__}.html"
    assert f'href="{page}' in estimator_html_repr(estimator)


def test_the_diagram_of_a_pipeline_links_every_step():
    html = estimator_html_repr(make_pipeline(*ESTIMATORS[:0:-1], ESTIMATORS[0]))
    pages = set(re.findall(rf"{DOCUMENTATION}/reference/sklearn_motionsync\.(\w+)\.html", html))
    assert pages == {type(estimator).__name__ for estimator in ESTIMATORS}


def test_reprs_are_short():
    bunch = make_bending(5, n_frames=20, random_state=0)
    for skeleton in (Skeleton.paper(), Skeleton.acclaim(), Skeleton.kinect(), bunch.skeleton):
        assert len(repr(DirectionCosines(skeleton))) < 80
    match = DenseSynchronizer(20).fit(bunch.data).match(bunch.data)
    assert repr(match) == "Match(5 performances on 20 frames)"
    # A pattern given as an array does not spell itself out.
    assert len(repr(DenseSynchronizer(pattern=bunch.data[0]))) < 2000
