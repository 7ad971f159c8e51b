"""The side of benchmarks/speed.py that runs in the peers' own environment.

Reads lines ``job file`` and answers each with the seconds of the processor that one run took;
``file`` holds performances (n, P, n_features).
"""

import contextlib
import importlib.metadata
import io
import sys
import time

import numpy as np

# Peers write to standard output, where the answers are to go.
ANSWERS = sys.stdout


def _dtai_pairs(X):
    from dtaidistance import dtw_ndim

    window = X.shape[1] // 4 + 1
    sequences = list(X)
    return lambda: dtw_ndim.distance_matrix_fast(sequences, window=window, only_triu=True)


def _dtai_path(X, share=0.25):
    from dtaidistance import dtw_ndim

    window = int(X.shape[1] * share) + 1
    return lambda: dtw_ndim.warping_path(X[0], X[1], window=window, use_c=True)


def _dtai_average(X):
    from dtaidistance import dtw_barycenter

    sequences = list(X)
    return lambda: dtw_barycenter.dba_loop(sequences, sequences[0], max_it=10, use_c=True)


def _aeon_pairs(X):
    from aeon.distances import dtw_pairwise_distance

    Y = np.ascontiguousarray(X.transpose(0, 2, 1))
    return lambda: dtw_pairwise_distance(Y, window=0.25)


def _aeon_path(X):
    from aeon.distances import dtw_alignment_path

    Y = np.ascontiguousarray(X.transpose(0, 2, 1))
    return lambda: dtw_alignment_path(Y[0], Y[1], window=0.25)


def _aeon_average(X):
    from aeon.clustering.averaging import elastic_barycenter_average

    Y = np.ascontiguousarray(X.transpose(0, 2, 1))
    return lambda: elastic_barycenter_average(Y, max_iters=10)


def _tslearn_pairs(X):
    from tslearn.metrics import cdist_dtw

    return lambda: cdist_dtw(X, sakoe_chiba_radius=X.shape[1] // 4)


def _tslearn_path(X):
    from tslearn.metrics import dtw_path

    return lambda: dtw_path(X[0], X[1], sakoe_chiba_radius=X.shape[1] // 4)


def _tslearn_average(X):
    from tslearn.barycenters import dtw_barycenter_averaging

    return lambda: dtw_barycenter_averaging(X, max_iter=10)


def _gdtw_path(X):
    import gdtw

    t = np.linspace(0, 1, X.shape[1])

    def run():
        solver = gdtw.GDTW()
        solver.set_params({"x": X[0], "y": X[1], "t": t})
        return solver.run()

    return run


def _fdasrsf_path(X):
    from fdasrsf.curve_functions import curve_to_q, optimum_reparam_curve

    first, second = (curve_to_q(np.ascontiguousarray(x.T))[0] for x in X[:2])
    return lambda: optimum_reparam_curve(first, second)


def _fdasrsf_average(X):
    from fdasrsf.curve_stats import fdacurve

    beta = np.ascontiguousarray(X.transpose(2, 1, 0))

    def run():
        curves = fdacurve(beta, mode="O", N=X.shape[1])
        curves.karcher_mean(rotation=False)
        curves.srvf_align(rotation=False)

    return run


def _affinewarp_average(X):
    from affinewarp import PiecewiseWarping

    return lambda: PiecewiseWarping(n_knots=1, smoothness_reg_scale=1.0).fit(X, verbose=False)


JOBS = {
    "dtaidistance pairs": _dtai_pairs,
    "dtaidistance path": _dtai_path,
    "dtaidistance long path": lambda X: _dtai_path(X, 0.05),
    "dtaidistance DBA": _dtai_average,
    "aeon pairs": _aeon_pairs,
    "aeon path": _aeon_path,
    "aeon DBA": _aeon_average,
    "tslearn pairs": _tslearn_pairs,
    "tslearn path": _tslearn_path,
    "tslearn DBA": _tslearn_average,
    "gdtw path": _gdtw_path,
    "fdasrsf path": _fdasrsf_path,
    "fdasrsf Karcher mean": _fdasrsf_average,
    "affinewarp fit": _affinewarp_average,
}


def serve():
    """Answer jobs until there are no more."""
    ready = {}
    for line in sys.stdin:
        job, path = line.rstrip("\n").split("\t")
        try:
            with contextlib.redirect_stdout(io.StringIO()):
                if (job, path) not in ready:
                    ready[job, path] = JOBS[job](np.load(path))
                start = time.process_time()
                ready[job, path]()
                answer = repr(time.process_time() - start)
        except Exception as error:  # a peer that fails must not end the comparison
            answer = f"failed: {error!r}".replace("\n", " ")
        print(answer, file=ANSWERS, flush=True)


def versions():
    """Print what is installed."""
    for name in ("dtaidistance", "aeon", "tslearn", "gdtw", "fdasrsf", "affinewarp"):
        with contextlib.suppress(importlib.metadata.PackageNotFoundError):
            print(name, importlib.metadata.version(name), end=", ")


if __name__ == "__main__":
    if sys.argv[1:] == ["versions"]:
        versions()
    elif len(sys.argv) == 3:
        # One job in a new process: what a user waits for the first time.
        JOBS[sys.argv[1]](np.load(sys.argv[2]))()
    else:
        serve()
