"""Where in whole recordings an action happens, beside subsequence DTW: the table of docs/design.md.

    python benchmarks/search.py DATA_FOLDER [utkinect] [hdm05]

UTKinect's 20 recordings hold ten actions each, once, labelled by hand. All but two actors at a time
teach an action by their clips, and the recordings of these two are searched. A hit is right if it
overlaps a labelled part that no better hit has, by half of what both cover together. All clips of
an actor of HDM05, joined in any order, are such a recording, too. Settings of the search were
chosen on the first four actors of UTKinect, and the others are searched. Prints Markdown.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from harness import command_line, print_head, print_row, run_tables
from scipy.spatial.distance import cdist
from sklearn.pipeline import make_pipeline
from sklearn_motionsync import ActionModel, ASpace, DenseSynchronizer, DirectionCosines
from sklearn_motionsync.datasets import load_trials
from sklearn_motionsync.takes import find_trials

P = 50
# Settings of the search were chosen on actors s01 to s04.
FOLDS = [("s05", "s06"), ("s07", "s08"), ("s09", "s10")]
# Steps of subsequence DTW that bound the rate to between a half and two.
STEPS = ((1, 1), (1, 2), (2, 1))


class Recordings(NamedTuple):
    """Clips that teach, whole takes to be searched, and where in these what happens."""

    clips: list
    actions: np.ndarray
    actors: np.ndarray
    takes: list
    actors_of_takes: np.ndarray
    parts: list

    @classmethod
    def joined(cls, path, every=2):
        """The clips of each actor one after the other, in random order, at half the rate."""
        bunch = load_trials(path)
        clips = DirectionCosines(bunch.skeleton).fit_transform(bunch.data)
        clips = [clip[::every] for clip in clips]
        rng, takes, parts = np.random.default_rng(0), [], []
        actors = np.asarray(bunch.actor)
        names = list(dict.fromkeys(actors))
        for take, actor in enumerate(names):
            order = rng.permutation(np.flatnonzero(actors == actor))
            takes.append(np.concatenate([clips[i] for i in order]))
            edges = np.cumsum([0, *(len(clips[i]) for i in order)]).tolist()
            parts += [(take, *edges[k : k + 2], str(bunch.target[i])) for k, i in enumerate(order)]
        return cls(clips, np.asarray(bunch.target), actors, takes, np.array(names), parts)

    @classmethod
    def read(cls, folder):
        bunch = load_trials(Path(folder) / "utkinect_positions.npz")
        cosines = DirectionCosines(bunch.skeleton)
        clips = list(cosines.fit_transform(bunch.data))
        file = np.load(Path(folder) / "utkinect_takes.npz")
        frames = file["positions"].reshape(len(file["positions"]), -1)
        takes = np.split(frames, file["offsets"][1:-1])
        names = "segment_take", "segment_start", "segment_stop", "segment_label"
        parts = list(zip(*(file[name].tolist() for name in names), strict=True))
        actions, actors = np.asarray(bunch.target), np.asarray(bunch.actor)
        return cls(clips, actions, actors, list(cosines.transform(takes)), file["actor"], parts)

    def teachers(self, action, held_out):
        chosen = np.flatnonzero((self.actions == action) & ~np.isin(self.actors, held_out))
        return [self.clips[i] for i in chosen], self.actors[chosen]

    def takes_of(self, actors):
        return np.flatnonzero(np.isin(self.actors_of_takes, actors))


# -- who searches: (take, start, stop, score), higher is better; only ours knows its threshold ----


def ours(recordings, action, held_out):
    clips, actors = recordings.teachers(action, held_out)
    pipe = make_pipeline(ASpace(), DenseSynchronizer(P), ActionModel())
    pipe.fit(clips, actionmodel__groups=actors)
    takes = recordings.takes_of(held_out)
    given = [recordings.takes[i] for i in takes]
    found = {}
    for threshold in ("auto", None):
        _, locations = find_trials(pipe, given, threshold=threshold, coverage=0.8)
        # The best ones of each take.
        locations = locations.sort_values("score").groupby("take").tail(30)
        rows = locations[["take", "start", "stop", "score"]].to_numpy()
        found[threshold] = [(takes[int(t)], int(a), int(b), s) for t, a, b, s in rows]
    return found


def dtw(recordings, action, held_out):
    """Subsequence DTW of the median clip, in the aSpace of the clips."""
    clips, _ = recordings.teachers(action, held_out)
    space = ASpace().fit(clips)
    points = space.transform(clips)
    pattern = points[DenseSynchronizer(P).fit(points).pattern_index_]
    hits = []
    for take in recordings.takes_of(held_out):
        x = space.transform([recordings.takes[take]])[0]
        costs, begins = subsequences(cdist(pattern, x, "sqeuclidean"))
        hits += [(take, start, stop, -cost) for start, stop, cost in best_apart(costs, begins)]
    return {None: hits}


def subsequences(costs):
    """Cheapest warping path of the whole pattern to every last frame, and where it begins."""
    n, m = costs.shape
    total, begin = np.full((n, m), np.inf), np.zeros((n, m), dtype=int)
    total[0], begin[0] = costs[0], np.arange(m)
    for i in range(1, n):
        for down, right in STEPS:
            if down <= i:
                before = total[i - down, : m - right]
                better = before < total[i, right:]
                total[i, right:][better] = before[better]
                begin[i, right:][better] = begin[i - down, : m - right][better]
        total[i] += costs[i]
    return total[-1] / n, begin[-1]


def best_apart(costs, begins, most=30):
    kept = []
    for j in np.argsort(costs, kind="stable"):
        start, stop = begins[j], j + 1
        if len(kept) < most and not any(start < b and a < stop for a, b, _ in kept):
            kept.append((start, stop, costs[j]))
    return kept


# -- how good they are ----------------------------------------------------------------------------


def judge(hits, parts):
    """Which hits are right, the best score first."""
    left, right = set(parts), []
    for take, start, stop, _ in sorted(hits, key=lambda hit: -hit[3]):
        overlaps = {part: overlap((start, stop), part[1:3]) for part in left if part[0] == take}
        best = max(overlaps, key=overlaps.get, default=None)
        right.append(best is not None and overlaps[best] >= 0.5)
        left -= {best} if right[-1] else set()
    return np.array(right, dtype=bool)


def overlap(a, b):
    shared = max(0, min(a[1], b[1]) - max(a[0], b[0]))
    return shared / (a[1] - a[0] + b[1] - b[0] - shared)


def at(right, count, n_hits):
    """Precision, recall and their harmonic mean of the best hits."""
    found = int(right[:n_hits].sum())
    return found / n_hits if n_hits else 1.0, found / count, 2 * found / (n_hits + count)


def figures(found, parts):
    """Precision, recall and F1 at the learnt threshold, if there is one, and F1 at the best one."""
    right, count = judge(found[None], parts), len(parts)
    sums = [at(right, count, k) for k in range(1, len(right) + 1)]
    best, learnt = max(sums, key=lambda three: three[2]), found.get("auto")
    own = best if learnt is None else at(judge(learnt, parts), count, len(learnt))
    return [*own, best[2]]


METHODS = {"find_trials": ours, "subsequence DTW": dtw}


def table(name, recordings, folds):
    """Precision, recall, F1 (DTW at its best threshold), and best F1."""
    print_head(name, METHODS)
    rows = []
    for action in dict.fromkeys(label for *_, label in recordings.parts):
        takes = recordings.takes_of(sum(folds, ()))
        parts = [p for p in recordings.parts if p[3] == action and p[0] in takes]
        rows.append([])
        for method in METHODS.values():
            found = {}
            for fold in folds:
                for threshold, hits in method(recordings, action, fold).items():
                    found.setdefault(threshold, []).extend(hits)
            rows[-1].append(figures(found, parts))
        show(action, rows[-1])
    show("mean", np.mean(rows, axis=0))


def show(name, row):
    print_row(name, [" ".join(f"{x:.2f}" for x in some) for some in row])


def utkinect(folder):
    table("UTKinect", Recordings.read(folder / "utkinect"), FOLDS)


def hdm05(folder):
    recordings = Recordings.joined(folder / "hdm05" / "hdm05_positions.npz")
    actors = recordings.actors_of_takes.tolist()
    table("HDM05, joined", recordings, [(actor,) for actor in actors])


if __name__ == "__main__":
    run_tables({"utkinect": utkinect, "hdm05": hdm05}, command_line(__doc__))
