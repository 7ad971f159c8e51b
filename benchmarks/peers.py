"""Other packages' alignments of a set to one time line.

A function takes a set, ``(n, P, n_features)``, and gives the warps of all to the mean that it finds
itself, ``(n, P)`` in frames. Alignments that are lists of index pairs are averaged over each frame
of the mean. ``TIME_LINES`` maps a label to the package, what makes the function, its settings, and
the features that it is to be fed.
"""

import contextlib
import os

import numpy as np


def tslearn_barycenter(**constraint):
    from tslearn.barycenters import dtw_barycenter_averaging
    from tslearn.metrics import dtw_path

    def align(X):
        mean, warps = dtw_barycenter_averaging(X, metric_params=constraint), []
        for x in X:
            frames, partners = np.transpose(dtw_path(mean, x, **constraint)[0])
            warps.append(np.bincount(frames, partners) / np.bincount(frames))
        return np.array(warps)

    return align


def tslearn_soft_barycenter(gamma):
    from tslearn.barycenters import softdtw_barycenter
    from tslearn.metrics import soft_dtw_alignment

    def align(X):
        mean, warps = softdtw_barycenter(X, gamma=gamma * np.square(X).sum(axis=2).mean()), []
        # gamma in units of the mean squared distance of features from their mean
        scale = np.square(mean - mean.mean(axis=0)).sum(axis=1).mean()
        for x in X:
            matrix = np.asarray(soft_dtw_alignment(mean, x, gamma=gamma * scale)[0])
            warps.append(matrix @ np.arange(len(x)) / matrix.sum(axis=1))
        return np.array(warps)

    return align


def affinewarp_pieces(n_knots):
    from affinewarp import PiecewiseWarping

    def align(X):
        # The search is random, and its seed cannot be set.
        model = PiecewiseWarping(n_knots)
        model.fit(X / X.std(), verbose=False)
        last = X.shape[1] - 1
        frames, knots = np.arange(last + 1), zip(model.y_knots, model.x_knots, strict=True)
        return np.array([np.interp(frames, last * mean, last * one) for mean, one in knots])

    return align


def fdasrsf_mean():
    from fdasrsf.curve_stats import fdacurve

    def align(X):
        n_frames = X.shape[1]
        curves = fdacurve(np.ascontiguousarray(X.transpose(2, 1, 0)), N=n_frames)
        with open(os.devnull, "w") as unread, contextlib.redirect_stdout(unread):
            curves.karcher_mean(rotation=False, cores=1)
            curves.srvf_align(rotation=False)
        return curves.gams.T * (n_frames - 1)

    return align


BOTH = ("pose", "velocity")
TIME_LINES = {
    "tslearn DBA": ("tslearn", tslearn_barycenter, [{}, {"sakoe_chiba_radius": 25}], BOTH),
    "tslearn soft-DTW barycentre": (
        "tslearn",
        tslearn_soft_barycenter,
        [{"gamma": g} for g in (0.01, 0.1, 1.0)],
        BOTH,
    ),
    "affinewarp": (
        "affinewarp",
        affinewarp_pieces,
        [{"n_knots": k} for k in (0, 1, 3)],
        BOTH,
    ),
    "fdasrsf Karcher mean": ("fdasrsf", fdasrsf_mean, [{}], ("pose", "smoothed")),
}


def settings(label):
    """Every (description, kind of features, function) of a peer."""
    _, make, options, kinds = TIME_LINES[label]
    for option in options:
        for kind in kinds:
            text = ", ".join([kind, *(f"{k}={v}" for k, v in option.items())])
            yield text, kind, make(**option)
