"""Why the defaults are what they are: one setting at a time, on real people.

    python benchmarks/choices.py DATA_FOLDER

Three events of accuracy.py, all ordered pairs: mean / median error in frames of 100. Health of
the warps of the bends: share of frames that stand still (rate below 0.1) and that hurry (above 2),
and the spread of velocities after synchronising over that after linear normalisation.
Prints Markdown.
"""

import sys
from pathlib import Path

import numpy as np
from accuracy import ALL_PAIRS, EVENTS, Clips, P
from sklearn_motionsync import DenseSynchronizer, LinearSynchronizer
from sklearn_motionsync.matching import costs
from sklearn_motionsync.matching.warps import sample
from sklearn_motionsync.metrics import sobolev_least_squares

CHOICES = {
    "smoothness": [0.001, 0.003, 0.01, 0.03, 0.1],
    "max_rate": [2, 4, 6],
    "subframes": [1, 2, 4],
    "velocity_smoothing": [0.02, 0.03, 0.05, 0.1],
    "consensus": [0, 4, 8, 16],
    "warp_smoothing": [0, 0.02, 0.03, 0.05],
}
# Not a parameter: w of the velocity cost, costs.step_table.
RATE_WEIGHTS = [0.0, 0.1, 0.2, 0.3, 1.0]


def times_to_all(X, **params):
    """tau of all ordered pairs, (n, n, P)."""
    return np.array(
        [
            DenseSynchronizer(P, pattern=n, refine=False, **params).fit(X).match(X).times
            for n in range(len(X))
        ]
    )


def rematched_to_mean(X, rounds):
    """The usual alternative to a vote: match again to the mean of the synchronised set."""
    result = []
    for n in range(len(X)):
        sync = DenseSynchronizer(P, pattern=n, consensus=0).fit(X)
        for _ in range(rounds):
            mean = sync.transform(X).mean(axis=0)
            sync = DenseSynchronizer(P, pattern=mean, consensus=0).fit(X)
        result.append(sync.match(X).times)
    return np.array(result)


def health(X, times):
    """Stand-still, hurry, spread of velocities."""
    linear, rates = LinearSynchronizer(P).fit(X), np.diff(times)
    before = linear.transform(X)
    spread = [sobolev_least_squares(before, sample(X, tau, P)) for tau in times]
    return f"{(rates < 0.1).mean():.0%} | {(rates > 2).mean():.0%} | {np.mean(spread):.2f}"


def row(label, clips, times_to_all=times_to_all, **params):
    """One line of the table."""
    cells, done = [], {}
    for name in ALL_PAIRS:
        action = EVENTS[name][1]
        if action not in done:
            done[action] = times_to_all(clips[name].X, **params)
        errors = clips[name].all_pairs(lambda X, n, t=done[action]: t[n])
        cells.append(f"{errors.mean():.2f} / {np.median(errors):.2f}")
    bends = clips[ALL_PAIRS[0]].X
    health_of_bends = health(bends, done[EVENTS[ALL_PAIRS[0]][1]])
    print(f"| {label} | " + " | ".join(cells) + f" | {health_of_bends} |", flush=True)


def main():
    """Print the table."""
    folder = Path(sys.argv[1])
    clips = {name: Clips(folder, *EVENTS[name]) for name in ALL_PAIRS}
    header = [*ALL_PAIRS, "stands still", "hurries", "spread of velocity"]
    print("| setting | " + " | ".join(header) + " |\n|---|" + "---|" * len(header))
    row("defaults", clips)
    for name, values in CHOICES.items():
        for value in values:
            row(f"`{name}={value}`", clips, **{name: value})
    default = costs.RATE_WEIGHT
    for weight in RATE_WEIGHTS:
        costs.RATE_WEIGHT = weight
        row(f"w = {weight}", clips)
    costs.RATE_WEIGHT = default
    for rounds in (1, 3):
        label = f"no vote, re-matched to the running mean, rounds: {rounds}"
        row(label, clips, rematched_to_mean, rounds=rounds)


if __name__ == "__main__":
    main()
