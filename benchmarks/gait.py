"""Foot strikes and foot-offs: of labelled files, and at lower frame rates and with noise.

    python benchmarks/gait.py DATA_FOLDER [--files FILE.c3d ...]

Errors are milliseconds; an event farther off than 150 ms is missed, one that no true event is near
is found in excess. *People*: the events of HDM05's jogs and CMU's walks at lower frame rates and
with noise, against those of the recordings as they are. *Files*: C3D files whose events name
strikes and foot-offs, such as those of force plates, with markers whose names `Skeleton.from_frame`
knows. Their heels are left out once, and once their toes, too; and the rule of Zeni and others is
run beside.

What is refused: people that stand, and most that exercise on the spot, have no events.
"""

import warnings
from pathlib import Path

import numpy as np
import pandas as pd
from exercises import LANDMARKS
from harness import command_line, print_head, print_row, run_tables
from scipy.ndimage import gaussian_filter1d
from scipy.signal import find_peaks
from sklearn_motionsync import Skeleton
from sklearn_motionsync.datasets import load_trials
from sklearn_motionsync.gait import gait_events
from sklearn_motionsync.gait.recordings import joints_of_feet
from sklearn_motionsync.io import read_motion

PEOPLE = {"hdm05": ("jogLeftCircle4StepsRstart", 1.0), "cmu07_walk": ("walk", 0.01)}
LABELS = ("Foot Strike", "Foot Off")
COUNTS = ("found", "missed", "bias", "error")
NEAR = 0.15
# Frame rates, and noise in metres.
SETTINGS = [(None, 0.0), (60, 0.0), (30, 0.0), (25, 0.0), (None, 0.01), (30, 0.01)]
# A foot swings by at least this share of its whole way, by the rule of Zeni and others.
SWING = 0.3


def thinned(x, rate, wanted):
    """Positions (n_frames, n) at a lower frame rate, on straight lines; NaN beside NaN."""
    if wanted is None or wanted >= rate:
        return x, rate
    times = np.arange(len(x)) / rate
    new = np.arange(0, times[-1] + 1e-9, 1 / wanted)
    return np.stack([np.interp(new, times, column) for column in x.T], axis=1), wanted


def compare(found, true):
    """Errors in seconds of the true events that are found, the number missed, and that in excess.

    Both are lists of (label, context, seconds).
    """
    errors, missed, used = {label: [] for label in LABELS}, dict.fromkeys(LABELS, 0), set()
    for label, context, time in true:
        near = [
            (abs(t - time), k) for k, (n, c, t) in enumerate(found) if (n, c) == (label, context)
        ]
        distance, k = min(near, default=(np.inf, None))
        if distance < NEAR:
            errors[label].append(found[k][2] - time)
            used.add(k)
        else:
            missed[label] += 1
    return errors, missed, len(found) - len(used)


def find(x, rate, skeleton, **how):
    """Events of one recording as (label, context, seconds)."""
    table = gait_events([x], skeleton, frame_rate=rate, **how)
    return list(table[["label", "context", "time"]].itertuples(index=False, name=None))


def by_extremes(x, rate, skeleton):
    """The rule of Zeni and others: the heel farthest ahead of the pelvis, the toe farthest behind.

    Ahead is where the pelvis goes.
    """
    ground = [k for k, axis in enumerate("xyz") if axis != skeleton.up[-1]]
    points = x.reshape(len(x), -1, 3)[..., ground]
    pelvis = np.nanmean(points[:, list(skeleton.indices_of("pelvis"))], axis=1)
    way = np.nanmean(np.diff(pelvis, axis=0), axis=0)
    ends, events = joints_of_feet(skeleton), []
    for side in ("left", "right"):
        for label, end, sign in zip(LABELS, ("heel", "toe"), (1, -1), strict=True):
            foot = np.nanmean(points[:, list(ends[f"{side}_{end}"])], axis=1)
            ahead = pd.Series(sign * (foot - pelvis) @ way / np.linalg.norm(way)).interpolate()
            least = SWING * (ahead.max() - ahead.min())
            events += [
                (label, side.capitalize(), k / rate) for k in find_peaks(ahead, prominence=least)[0]
            ]
    return events


def events_head(corner):
    print_head(corner, [f"{label}: {what}" for label in LABELS for what in COUNTS])


def events_row(name, triples):
    """Mean and absolute errors of many recordings."""
    cells = []
    for label in LABELS:
        errors = 1000 * np.concatenate([np.array(e[label]) for e, _, _ in triples])
        cells += [str(len(errors)), str(sum(m[label] for _, m, _ in triples))]
        cells += [f"{x.mean():.1f}" if len(x) else "-" for x in (errors, np.abs(errors))]
    print_row(name, cells)


def name_of(setting):
    rate, noise = setting
    return f"{rate or 'own'} Hz" + (f", {100 * noise:g} cm of noise" if noise else "")


def people(folder):
    for archive, (label, metres) in PEOPLE.items():
        bunch = load_trials(folder / archive / f"{archive}_positions.npz")
        chosen = np.flatnonzero(bunch.target == label)
        of_settings = {}
        for k in chosen:
            x, rate = np.asarray(bunch.data[k], dtype=float) * metres, bunch.frame_rate[k]
            whole = find(x, rate, bunch.skeleton)
            for setting in SETTINGS[1:]:
                noise = np.random.default_rng(k).normal(0, setting[1], x.shape)
                found = find(*thinned(x + noise, rate, setting[0]), bunch.skeleton)
                of_settings.setdefault(setting, []).append(compare(found, whole))
        events_head(f"{archive}, {len(chosen)} takes, against the events as recorded")
        for setting, triples in of_settings.items():
            events_row(name_of(setting), triples)


def marked(df):
    """The events that a file names, as (label, context, seconds)."""
    rate = df.attrs["frame_rate"]
    return [
        (e["label"], e["context"], e["frame"] / rate)
        for e in df.attrs["events"]
        if e["label"] in LABELS
    ]


def labelled(files):
    events_head(f"{len(files)} labelled files")
    marks = ("HEE", "TOE")
    for what, left_out in (("heel and toe", ()), ("ankle and toe", marks[:1]), ("ankle", marks)):
        for setting in SETTINGS if not left_out else SETTINGS[:1]:
            triples = []
            for path in files:
                df = read_motion(path)
                names = [c for c in df if not any(c[:-2].endswith(mark) for mark in left_out)]
                skeleton = Skeleton.from_frame(df[names])
                x, rate = df[names].to_numpy(dtype=float), df.attrs["frame_rate"]
                x = x + np.random.default_rng(0).normal(0, 1000 * setting[1], x.shape)
                x, rate = thinned(x, rate, setting[0])
                triples.append(compare(find(x, rate, skeleton), marked(df)))
            events_row(f"{what}, {name_of(setting)}", triples)
    triples = []
    for path in files:
        df = read_motion(path)
        rate, skeleton = df.attrs["frame_rate"], Skeleton.from_frame(df)
        found = by_extremes(df.to_numpy(dtype=float), rate, skeleton)
        triples.append(compare(found, marked(df)))
    events_row("farthest ahead, behind", triples)


def refused(folder, every=1):
    """People that stand, and exercises on the spot: sit to stand, shoulders up and turned."""
    bunch = load_trials(folder / "uiprmd" / "uiprmd_odd_positions.npz")
    skeleton = Skeleton(bunch.joints, bunch.skeleton.parents, LANDMARKS, up="z")
    rng = np.random.default_rng(0)
    counts = {"standing": []} | {name: [] for name in np.unique(bunch.target)}
    recordings = list(zip(bunch.data, bunch.target, bunch.frame_rate, strict=True))
    for x, label, rate in recordings[::every]:
        counts[label].append(len(find(np.asarray(x, dtype=float), rate, skeleton)))
        sway = 20 * gaussian_filter1d(rng.normal(size=(250, 1, 3)), 25, axis=0)
        still = x[0].reshape(1, -1, 3) + sway + rng.normal(0, 1, (250, x.shape[1] // 3, 3))
        counts["standing"].append(len(find(still.reshape(250, -1), rate, skeleton)))
    print_head("refused", ["recordings", "with events, %"])
    for name, found in counts.items():
        print_row(name, [str(len(found)), f"{100 * np.mean(np.array(found) > 0):.1f}"])


TABLES = {"people": people, "refused": refused}


def with_files(options):
    if options.files:
        TABLES["files"] = lambda folder: labelled(options.files)


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    command = command_line(__doc__)
    command.add_argument("--files", type=Path, nargs="*", default=[])
    run_tables(TABLES, command, with_files)
