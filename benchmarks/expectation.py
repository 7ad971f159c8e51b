"""Errors of hidden features that an ASpace expects, beside other ways (docs/design.md).

Gaps are cut into real performances: two joints of a limb for a second, in 30 % of the clips; single
joints that flicker, 10 % of the time; a tenth of all frames. Direction cosines are filled by an
ASpace of all components, frame by frame (rows), and by others. Prints the root mean square error of
the features that were hidden, over three ways to cut, and what the shrinkage is good for.

    python benchmarks/expectation.py ../shared/data
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"

import sys
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.interpolate import CubicSpline
from sklearn.experimental import enable_iterative_imputer  # noqa: F401
from sklearn.impute import IterativeImputer, KNNImputer
from sklearn_motionsync import ASpace, DirectionCosines
from sklearn_motionsync.datasets import load_performances
from sklearn_motionsync.io import fill_gaps
from sklearn_motionsync.matching import gaps as filling

# Rows a second of the Kinect, about.
RATES = {"hdm05": 120, "utkinect": 15}
ACTIONS = {
    "hdm05": (
        "depositFloorR",
        "grabHighR",
        "elbowToKnee1RepsLelbowStart",
        "jogLeftCircle4StepsRstart",
    ),
    "utkinect": ("sitDown", "pickUp", "waveHands"),
}
LIMBS = ("shoulder", "elbow"), ("elbow", "wrist"), ("knee", "ankle")
# scikit-learn's iterative imputer takes minutes of more rows.
FEW = 2500


def cut(X, skeleton, kind, rate, rng):
    """Copies of positions with gaps."""
    X = [x.reshape(len(x), -1, 3).copy() for x in X]
    joints = {name: skeleton.index_of(name) for name in skeleton.landmarks}
    if kind == "limb":
        for i in rng.permutation(len(X))[: round(0.3 * len(X))]:
            side, limb = rng.choice(["left", "right"]), LIMBS[rng.integers(len(LIMBS))]
            start = rng.integers(max(1, len(X[i]) - rate))
            for name in limb:
                X[i][start : start + rate, joints[f"{side}_{name}"]] = np.nan
    for x in X:
        if kind == "flicker":
            for joint in joints.values():
                x[rng.random(len(x)) < 0.1, joint] = np.nan
        if kind == "frames":
            gone, length = np.zeros(len(x), dtype=bool), max(1, rate // 6)
            while gone.mean() < 0.1:
                start = rng.integers(1, len(x) - 1)
                gone[start : min(start + length, len(x) - 1)] = True
            x[gone] = np.nan
    return [x.reshape(len(x), -1) for x in X]


def along_time(X, way):
    """Performances filled feature by feature; ends are held, and what was never seen stays NaN."""
    out = []
    for x in X:
        df = pd.DataFrame(x)
        if way == "spline":
            for k in df.columns[df.isna().any() & (df.notna().sum() > 3)]:
                known = df.index[df[k].notna()]
                df[k] = df[k].fillna(pd.Series(CubicSpline(known, df[k][known])(df.index)))
        out.append(df.interpolate(limit_direction="both").to_numpy())
    return out


def expected(X):
    """Performances filled by an ASpace, and frames of which nothing was seen along time."""
    aspace = ASpace(1.0).fit(X)
    return along_time(aspace.inverse_transform(aspace.transform(X)), "line")


def ways(gaps, postures, cosines, columns):
    """Filled postures of each way."""
    rows = np.concatenate(postures)
    mean = np.nanmean(rows, axis=0)
    short, whole = (
        cosines.transform([fill_gaps(pd.DataFrame(x, columns=columns), n).to_numpy() for x in gaps])
        for n in (10, 10**6)
    )
    yield "ASpace", expected(postures)
    yield "fill_gaps, ASpace", expected(short)
    seen = ~np.isnan(rows).all(axis=1)
    aspace, filled = ASpace(1.0).fit(rows), np.repeat(mean[np.newaxis], len(rows), axis=0)
    filled[seen] = aspace.inverse_transform(aspace.transform(rows[seen]))
    yield "rows", filled
    yield "fill_gaps", along_time(whole, "line")
    yield "line", along_time(postures, "line")
    yield "spline", along_time(postures, "spline")
    yield "mean", np.where(np.isnan(rows), mean, rows)
    yield "KNNImputer", KNNImputer().fit_transform(rows)
    if len(rows) < FEW:
        yield "IterativeImputer", IterativeImputer(random_state=0).fit_transform(rows)


def examine(folder, name, action, kind, fill):
    """Root mean square errors by way, over three ways to cut."""
    bunch = load_performances(folder / name / f"{name}_positions.npz")
    X = [x.astype(float) for x, t in zip(bunch.data, bunch.target, strict=True) if t == action]
    columns, found = bunch.skeleton.column_names, {}
    truth = np.concatenate(DirectionCosines(bunch.skeleton).fit_transform(X))
    for seed in range(3):
        gaps = cut(X, bunch.skeleton, kind, RATES[name], np.random.default_rng(seed))
        cosines = DirectionCosines(bunch.skeleton, hidden="nan").fit(gaps)
        postures = cosines.transform(gaps)
        hidden, mean = np.isnan(np.concatenate(postures)), np.nanmean(np.concatenate(postures), 0)
        for way, filled in fill(gaps, postures, cosines, columns):
            rows = np.concatenate(filled) if isinstance(filled, list) else filled
            rows = np.where(np.isnan(rows), mean, rows)
            found.setdefault(way, []).append(np.square(rows - truth)[hidden].mean())
    return {way: np.sqrt(np.mean(squares)) for way, squares in found.items()}


def shrunk(gaps, postures, cosines, columns):
    """The ASpace with other shrinkages, and without time."""
    before = filling.SHRINKAGE
    for share in (0.001, 0.01, 0.03, 0.1, 0.3):
        filling.SHRINKAGE = share
        yield f"{share:g}", expected(postures)
    filling.SHRINKAGE = before


def main(folder):
    # Features hardly ever seen, and imputers that do not converge.
    warnings.simplefilter("ignore")
    for kind, fill in (("limb", ways), ("flicker", ways), ("frames", ways), ("limb", shrunk)):
        rows = {
            action: examine(Path(folder), name, action, kind, fill)
            for name, actions in ACTIONS.items()
            for action in actions
        }
        print(f"\n{kind}{', by shrinkage' if fill is shrunk else ''}")
        table = pd.DataFrame(rows).T
        table.loc["geometric mean"] = np.exp(np.log(table).mean(skipna=False))
        print(table.to_string(float_format=lambda x: f"{x:.4f}"), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
