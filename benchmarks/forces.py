"""Vertical ground forces of walking people: how closely peaks and valley come together in time.

    pip install . spm1d fdatools fdasrsf
    python benchmarks/forces.py

The wheel of spm1d holds the forces of ten people, sixty steps each, twenty at each of three speeds,
from heel strike to toe-off on 101 frames (Pataky et al., 2008). First peak, valley and second peak
are found in the recorded curve, by a parabola through three frames, and taken to the common clock
by the warp. The number is their standard deviation there, within a person, in per cent of stance,
averaged over the people. Every method sees the sixty steps of one person at a time, and nothing of
the events.

A second table has the knee and the hip of 39 children (Ramsay and Silverman, from fdatools), each
alone and both together: where the knee is bent and stretched most, and the hip stretched most. Its
last columns are the shares of frames that stand still (rate below 0.1) and hurry (above 2). Prints
Markdown.
"""

import sys
import warnings
from pathlib import Path

import numpy as np
from harness import on_time_line, print_head, print_row, vertex
from scipy.interpolate import CubicSpline
from sklearn_motionsync import DenseSynchronizer


def read_forces():
    """One array (60, 101) of each person."""
    import spm1d

    folder = Path(spm1d.__file__).parent / "data" / "datafiles"
    return [np.load(path) for path in sorted(folder.glob("ex_grf_subj*.npy"))]


def events(curve):
    """Frames of the first peak, the valley and the second peak, with fractions."""
    first = 5 + np.argmax(curve[5:45])
    second = 55 + np.argmax(curve[55:96])
    valley = first + np.argmin(curve[first : second + 1])
    return np.array([vertex(curve, frame) for frame in (first, valley, second)])


def read_children():
    """Hip and knee angles, (39, 101, 2): splines through the twenty recorded frames."""
    from fdatools.datasets import load_gait

    gait = load_gait()
    grid = np.linspace(gait.t[0], gait.t[-1], 101)
    return CubicSpline(gait.t, gait.value)(grid).transpose(1, 0, 2)


def events_of_child(angles):
    """Frames at which the knee is bent, stretched, and bent again, and the hip stretched most."""
    hip, knee = angles.T
    first, swing = np.argmax(knee[:28]), 55 + np.argmax(knee[55:96])
    stance = first + np.argmin(knee[first : swing + 1])
    found = [vertex(knee, frame) for frame in (first, stance, swing)]
    return np.array([*found, vertex(hip, 30 + np.argmin(hip[30:75]))])


def spreads(moments, times):
    """Standard deviations of moments of trials on the common clock, in per cent."""
    return [on_time_line(times, at)[1] * 100 / (times.shape[1] - 1) for at in np.transpose(moments)]


def linear(curves):
    return np.tile(np.arange(curves.shape[1], dtype=float), (len(curves), 1))


def dense(**params):
    def times(curves):
        trials = list(curves[:, :, np.newaxis] if curves.ndim == 2 else curves)
        return DenseSynchronizer(**params).fit(trials).match(trials).times

    return times


def continuous(curves):
    """Registration of Ramsay and Silverman, by fdatools; four settings were tried."""
    from fdatools import BSpline, register, smooth

    grid = np.linspace(0, 1, curves.shape[1])
    smoothed = smooth(curves.T, grid, basis=BSpline(domain=(0.0, 1.0), n_basis=43), lam=1e-9).fd
    warp_basis = BSpline(domain=(0.0, 1.0), n_basis=8)
    found = register(smoothed, warp_basis=warp_basis, lam=1e-3, criterion="eigen")
    return np.asarray(found.warp_values(grid)).T * (len(grid) - 1)


def elastic(curves):
    """Square-root velocities and their Karcher mean, by fdasrsf; a penalty was no better."""
    from fdasrsf import fdawarp

    grid = np.linspace(0, 1, curves.shape[1])
    found = fdawarp(np.ascontiguousarray(curves.T), grid)
    found.srsf_align(parallel=False, verbose=False)
    return found.gam.T * (len(grid) - 1)


METHODS = {
    "linear time normalisation": linear,
    "the paper's method": dense(cost="pose", metric=None, consensus=0, max_rate=2),
    "`DenseSynchronizer()`": dense(),
    '`DenseSynchronizer(cost="elastic")`': dense(cost="elastic"),
    "`fdatools.register`, 8 functions, 1e-3": continuous,
    "`fdasrsf`, mean": elastic,
}


def children_table():
    """Knee, hip, and both together; health is that of the three in the mean."""
    children = read_children()
    moments = np.array([events_of_child(x) for x in children])
    methods = {"linear time normalisation": linear, "`DenseSynchronizer()`": dense()}
    print_head("method", ["knee alone", "hip alone", "knee and hip together", "still", "hurry"])
    for method, times in methods.items():
        cells, rates = [], []
        for joints, at in ((slice(1, 2), slice(3)), (slice(1), slice(3, 4)), (slice(2), slice(4))):
            found = times(children[:, :, joints])
            cells.append(", ".join(f"{x:.2f}" for x in spreads(moments[:, at], found)))
            rates.append(np.diff(found, axis=1))
        cells += [f"{np.mean(np.array(rates) < 0.1):.1%}", f"{np.mean(np.array(rates) > 2):.1%}"]
        print_row(method, cells)


def main():
    people = read_forces()
    print_head("method", ["first peak", "valley", "second peak", "mean"])
    for method, times in METHODS.items():
        with warnings.catch_warnings():
            # Those of the peers.
            warnings.simplefilter("ignore")
            of_people = np.array([spreads(list(map(events, y)), times(y)) for y in people])
        means = [*of_people.mean(axis=0), of_people.mean()]
        print_row(method, [f"{mean:.2f}" for mean in means])
    children_table()


if __name__ == "__main__":
    sys.exit(main())
