"""Two groups of people: is the difference in shape or in timing, and how often is it found.

    python benchmarks/groups.py [N_SEEDS [N_JOBS]]

Cycles of `make_gait`, whose differences are known, 20 people of two cycles each. All are put on one
clock without a look at the groups, then the means of people are compared: the curve as linear time
normalisation gives it, the synchronised curve alone, the offset (in per cent of the cycle) alone,
and curve and offset together, by Hotelling's T2 at every frame. The p-value is that of the largest
T2 of the cycle among permutations of the people, so it holds for all frames at once. Where nothing
varies, as the offset does not at both ends of the clock, and the force not in the air, that channel
is left out. Prints Markdown: how often each test says that the groups differ, at 5 %.

Seeds from 0 on are reported. The sizes of the differences and the spread of people in
`make_gait` were chosen on seeds from 1000 on.
"""

import os
import sys

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")

from typing import NamedTuple

import numpy as np
from accuracy import print_head, print_row
from joblib import Parallel, delayed
from sklearn_motionsync import DenseSynchronizer, LinearSynchronizer
from sklearn_motionsync.datasets import make_gait

P = 101
PEOPLE, CYCLES = 20, 2
LEVEL = 0.05
PERMUTATIONS = 999
# A channel varies at a frame if its spread there is more than this share of its largest.
VARIES = 1e-3

DIFFERENCES = {
    "nothing": {},
    "timing, 2 %": {"timing": 2},
    "timing, 3 %": {"timing": 3},
    "shape, 8 degrees": {"amplitude": 8},
    "both, 3 % and 8 degrees": {"timing": 3, "amplitude": 8},
    "timing, 3 %, pace varies more": {"timing": 3, "warp": 1.5},
}
CHANNELS = ("hip_flexion", "knee_flexion", "vertical_force")
LINEAR, CURVE, OFFSET, JOINT = (
    "linear normalisation, curve",
    "synchronised, curve alone",
    "synchronised, offset alone",
    "synchronised, curve and offset",
)
TRUE = "true times, curve and offset"
TESTS = (LINEAR, CURVE, OFFSET, JOINT, TRUE)


# -- the test ---------------------------------------------------------------------------


def whitened(fields):
    """Fields (n, P, C) so turned at every frame that all in all they have unit covariance.

    Hotelling's T2 grows with the squared length of the sum of a group there, for a given number of
    people in it, so it need not be computed. Channels that do not vary are 0, and frames at which
    none does are left out.
    """
    centred = fields - fields.mean(axis=0)
    spread = centred.std(axis=0)
    varies = spread > VARIES * spread.max(axis=0)
    scaled = np.where(varies, centred / np.where(varies, spread, 1), 0).transpose(1, 0, 2)
    left, sizes, _ = np.linalg.svd(scaled[varies.any(axis=1)], full_matrices=False)
    return left * (sizes > 1e-6 * sizes[:, :1])[:, np.newaxis]


def largest_of_permutations(fields, in_second, n_permutations, rng):
    """The largest squared length over all frames, as the groups are, and of permutations."""
    white = whitened(fields)
    deals = np.stack([in_second] + [rng.permutation(in_second) for _ in range(n_permutations)])
    sums = np.einsum("dn,pnc->dpc", deals.astype(np.float64), white, optimize=True)
    return (sums**2).sum(axis=2).max(axis=1)


def p_value(fields, in_second, n_permutations=PERMUTATIONS, random_state=0):
    """That two groups of people differ so much at some frame, if nothing distinguishes them.

    fields : (n_people, P) or (n_people, P, n_channels); in_second : bool (n_people,).
    """
    fields = fields.reshape(*fields.shape[:2], -1)
    rng = np.random.default_rng(random_state)
    found = largest_of_permutations(fields, np.asarray(in_second), n_permutations, rng)
    return float((found >= found[0] * (1 - 1e-9)).mean())


# -- people on one clock ----------------------------------------------------------------


class OnClock(NamedTuple):
    """Means of people: curves (n_people, P, n_features), offsets (n_people, P) in per cent."""

    curves: np.ndarray
    offsets: np.ndarray


def of_people(values, person):
    """Means over the cycles of each person, in the order in which they come."""
    return np.stack([values[person == who].mean(axis=0) for who in dict.fromkeys(person)])


def synchronised(bunch):
    """By `DenseSynchronizer`, every feature in units of its spread."""
    spread = np.concatenate(bunch.data).std(axis=0)
    scaled = [x / spread for x in bunch.data]
    match = DenseSynchronizer(P).fit(scaled).match(scaled)
    offsets = 100 * match.offsets / (P - 1)
    return OnClock(
        of_people(match.warp(bunch.data), bunch.person), of_people(offsets, bunch.person)
    )


def truly_synchronised(bunch):
    """By the true times."""
    moments = np.linspace(0, 1, P)
    curves, offsets = [], []
    for x, times in zip(bunch.data, bunch.times, strict=True):
        curves.append(np.stack([np.interp(moments, times, f) for f in x.T], axis=1))
        offsets.append(100 * (np.interp(moments, times, np.linspace(0, 1, len(x))) - moments))
    curves, offsets = (of_people(np.stack(v), bunch.person) for v in (curves, offsets))
    return OnClock(curves, offsets)


def p_values(seed, params, channels, people, cycles):
    """Of every test and channel, on people of this seed: {(test, channel): p}."""
    bunch = make_gait(people, cycles, random_state=seed, **params)
    in_second = of_people(bunch.group == bunch.group_names[1], bunch.person) > 0
    ours, truth = synchronised(bunch), truly_synchronised(bunch)
    linear = of_people(LinearSynchronizer(P).fit_transform(bunch.data), bunch.person)
    found = {}
    for channel in channels:
        i = bunch.feature_names.index(channel)
        fields = {
            LINEAR: linear[:, :, i],
            CURVE: ours.curves[:, :, i],
            OFFSET: ours.offsets,
            JOINT: np.stack([ours.curves[:, :, i], ours.offsets], axis=2),
            TRUE: np.stack([truth.curves[:, :, i], truth.offsets], axis=2),
        }
        for test, values in fields.items():
            found[test, channel] = p_value(values, in_second, random_state=seed)
    return found


# -- tables -----------------------------------------------------------------------------


def main():
    n_seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    n_jobs = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    found = {}
    for name, params in DIFFERENCES.items():
        with Parallel(n_jobs=n_jobs) as parallel:
            found[name] = parallel(
                delayed(p_values)(s, params, CHANNELS, PEOPLE, CYCLES) for s in range(n_seeds)
            )
        print(name, "done", file=sys.stderr, flush=True)
    for channel in CHANNELS:
        print_head(f"`{channel}`, differs by", TESTS)
        for name, of_seeds in found.items():
            said = [np.array([p[test, channel] <= LEVEL for p in of_seeds]) for test in TESTS]
            print_row(name, [f"{100 * s.mean():.1f}" for s in said])


if __name__ == "__main__":
    main()
