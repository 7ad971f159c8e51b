"""Other packages' pairwise alignments, as times tau(p) of one sequence on the clock of another.

Each function takes a base and a moving sequence, ``(P, n_features)`` both, and gives ``tau`` of
shape ``(P,)`` in frames. Alignments that are lists of index pairs are averaged over each
frame of the base. ``PEERS`` maps a label to a function and the features it is to be fed.
"""

import importlib.metadata

import numpy as np


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


def installed(label):
    """The version of a peer, or None."""
    try:
        return importlib.metadata.version(PEERS[label][0])
    except importlib.metadata.PackageNotFoundError:
        return None


def settings(label):
    """Every (description, kind of features, function) of a peer."""
    _, make, options, kinds = PEERS[label]
    for option in options:
        for kind in kinds:
            text = ", ".join([kind, *(f"{k}={v}" for k, v in option.items())])
            yield text, kind, make(**option)
