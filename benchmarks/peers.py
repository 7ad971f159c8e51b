"""Other packages' alignments: of one sequence to another, and of a set to one time line.

Each function takes a base and a moving sequence, ``(P, n_features)`` both, and gives ``tau`` of
shape ``(P,)`` in frames. Alignments that are lists of index pairs are averaged over each
frame of the base. ``PEERS`` maps a label to a function and the features it is to be fed.
Functions of ``TIME_LINES`` take a set, ``(n, P, n_features)``, and give the warps of all to the
mean that they find themselves, ``(n, P)``.
"""

import contextlib
import os

import numpy as np
from harness import version_of


def _from_pairs(pairs, n_frames):
    """Mean partner of each frame; frames without one, as derivatives have at the ends, between."""
    pairs = np.asarray(pairs)
    frames = np.unique(pairs[:, 0])
    partners = [pairs[pairs[:, 0] == frame, 1].mean() for frame in frames]
    return np.interp(np.arange(n_frames), frames, partners)


def tslearn_dtw(radius=None):
    from tslearn.metrics import dtw_path

    constraint = {} if radius is None else {"sakoe_chiba_radius": radius}
    return lambda x, y: _from_pairs(dtw_path(x, y, **constraint)[0], len(x))


def tslearn_soft_dtw(gamma):
    from tslearn.metrics import soft_dtw_alignment

    def align(x, y):
        # gamma in units of the mean squared distance of features from their mean
        scale = np.square(x - x.mean(axis=0)).sum(axis=1).mean()
        matrix = np.asarray(soft_dtw_alignment(x, y, gamma=gamma * scale)[0])
        return matrix @ np.arange(len(y)) / matrix.sum(axis=1)

    return align


def dtaidistance_dtw(window=None, penalty=None):
    from dtaidistance import dtw_ndim

    def align(x, y):
        scale = np.sqrt(np.square(x - x.mean(axis=0)).sum(axis=1).mean())
        options = {} if penalty is None else {"penalty": penalty * scale}
        path = dtw_ndim.warping_path(x, y, window=window, use_c=True, **options)
        return _from_pairs(path, len(x))

    return align


def gdtw_warp(lambda_cum, lambda_inst):
    import gdtw

    def align(x, y):
        t = np.linspace(0, 1, len(x))
        solver = gdtw.GDTW()
        solver.set_params(
            {"x": y, "y": x, "t": t, "lambda_cum": lambda_cum, "lambda_inst": lambda_inst}
        )
        return solver.run().phi(t) * (len(x) - 1)

    return align


def fdasrsf_srvf(lam=0.0):
    from fdasrsf.curve_functions import curve_to_q, optimum_reparam_curve

    def align(x, y):
        q1, q2 = (curve_to_q(np.ascontiguousarray(z.T))[0] for z in (x, y))
        return np.asarray(optimum_reparam_curve(q1, q2, lam=lam)) * (len(x) - 1)

    return align


def aeon_path(name, **options):
    import aeon.distances

    function = getattr(aeon.distances, f"{name}_alignment_path")

    def align(x, y):
        pairs = np.asarray(function(x.T.copy(), y.T.copy(), **options)[0])
        # The derivative of a sequence lacks its first and last frame.
        return _from_pairs(pairs + (name == "ddtw"), len(x))

    return align


# -- sets ---------------------------------------------------------------------------------


def tslearn_barycenter(radius=None):
    from tslearn.barycenters import dtw_barycenter_averaging

    constraint = {} if radius is None else {"sakoe_chiba_radius": radius}
    to_mean = tslearn_dtw(radius)

    def align(X):
        mean = dtw_barycenter_averaging(X, metric_params=constraint)
        return np.array([to_mean(mean, x) for x in X])

    return align


def tslearn_soft_barycenter(gamma):
    from tslearn.barycenters import softdtw_barycenter

    to_mean = tslearn_soft_dtw(gamma)

    def align(X):
        mean = softdtw_barycenter(X, gamma=gamma * np.square(X).sum(axis=2).mean())
        return np.array([to_mean(mean, x) for x in X])

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


def fdasrsf_mean(lam=0.0):
    from fdasrsf.curve_stats import fdacurve

    def align(X):
        n_frames = X.shape[1]
        curves = fdacurve(np.ascontiguousarray(X.transpose(2, 1, 0)), N=n_frames)
        with open(os.devnull, "w") as unread, contextlib.redirect_stdout(unread):
            curves.karcher_mean(rotation=False, lam=lam, cores=1)
            curves.srvf_align(rotation=False, lam=lam)
        return curves.gams.T * (n_frames - 1)

    return align


def skfda_elastic(penalty):
    from skfda import FDataGrid
    from skfda.preprocessing.registration import FisherRaoElasticRegistration

    # One curve only: the first of the features.
    def align(X):
        n_frames = X.shape[1]
        frames = np.arange(n_frames, dtype=float)
        register = FisherRaoElasticRegistration(penalty=penalty)
        register.fit_transform(FDataGrid(X[:, :, 0], frames / frames[-1]))
        warps = register.warping_(frames / frames[-1])
        return warps[:, :, 0] * frames[-1]

    return align


# label: (distribution, maker, list of settings, kinds of features)
BOTH = ("posture", "velocity")
PEERS = {
    "tslearn DTW": ("tslearn", tslearn_dtw, [{}, {"radius": 25}], BOTH),
    "tslearn soft-DTW": (
        "tslearn",
        tslearn_soft_dtw,
        [{"gamma": g} for g in (0.003, 0.01, 0.03, 0.1, 0.3)],
        BOTH,
    ),
    "dtaidistance DTW": (
        "dtaidistance",
        dtaidistance_dtw,
        [{"window": 26}, {"window": 26, "penalty": 0.1}, {"window": 26, "penalty": 0.3}],
        BOTH,
    ),
    "gdtw": (
        "gdtw",
        gdtw_warp,
        [
            {"lambda_cum": c, "lambda_inst": i}
            for c, i in ((0, 0.01), (0, 0.1), (0, 1), (1, 0.1), (1, 1), (0.1, 0.3))
        ],
        BOTH,
    ),
    "fdasrsf SRVF": ("fdasrsf", fdasrsf_srvf, [{}], ("posture", "smoothed")),
    "aeon DTW": ("aeon", aeon_path, [{"name": "dtw", "window": 0.25}], BOTH),
    "aeon derivative DTW": ("aeon", aeon_path, [{"name": "ddtw"}], ("posture", "smoothed")),
    "aeon ADTW": (
        "aeon",
        aeon_path,
        [{"name": "adtw", "warp_penalty": w} for w in (0.0001, 0.001, 0.01)],
        BOTH,
    ),
    "aeon shape-DTW": ("aeon", aeon_path, [{"name": "shape_dtw", "reach": 5}], BOTH),
}

TIME_LINES = {
    "tslearn DBA": ("tslearn", tslearn_barycenter, [{}, {"radius": 25}], BOTH),
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
    "fdasrsf Karcher mean": ("fdasrsf", fdasrsf_mean, [{}], ("posture", "smoothed")),
    "scikit-fda elastic": (
        "scikit-fda",
        skfda_elastic,
        [{"penalty": p} for p in (0.0, 0.1, 1.0)],
        ("speed", "smoothed"),
    ),
}


def leave_out():
    """Have no peer run, whatever is installed."""
    PEERS.clear()
    TIME_LINES.clear()


def installed(label):
    """The version of a peer, or None."""
    return version_of((PEERS | TIME_LINES)[label][0])


def settings(label):
    """Every (description, kind of features, function) of a peer."""
    _, make, options, kinds = (PEERS | TIME_LINES)[label]
    for option in options:
        for kind in kinds:
            text = ", ".join([kind, *(f"{k}={v}" for k, v in option.items())])
            yield text, kind, make(**option)
