"""A pipeline that several displays draw."""

import pytest
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import ActionModel, ASpace, DenseSynchronizer, DirectionCosines
from sklearn_motionsync.datasets import make_bending


@pytest.fixture(scope="package")
def bunch():
    return make_bending(9, n_frames=40, random_state=3)


@pytest.fixture(scope="package")
def pipe(bunch):
    steps = DirectionCosines(bunch.skeleton), ASpace(3), DenseSynchronizer(30), ActionModel()
    return make_pipeline(*steps).fit(bunch.data)
