"""Key-frames: what one known moment does for the others, labels of a few clips, and wrong labels.

    python benchmarks/keyframes.py DATA_FOLDER [given] [few] [wrong]

``given``: of every two moments of an action (harness.py) one is given, and the error of the other is
judged on the pairs of clips that show both; with people who had no part in the fit, too. ``few``: a
fifth of the clips have the moment, and it is judged in the others. ``wrong``: in one clip of five
the moment that is given is wrong by a tenth of the clip. Errors are in frames of 100, mean and
median. Prints Markdown.
"""

import sys

import numpy as np
from harness import EVENTS, FLOOR, FOLDS, P, read_people
from sklearn.model_selection import GroupKFold
from sklearn_motionsync import ASpace, DenseSynchronizer, LinearSynchronizer

FRAMES = np.arange(P)
FEW, DRAWS = 0.2, 4


def own_frames(at, X):
    """Moments in frames of 100 as key-frames of clips, one row each."""
    return (np.asarray(at) / (P - 1) * (np.array([len(x) for x in X]) - 1))[:, np.newaxis]


# -- the methods: warps of some clips to a template, after a fit to others ----------------------


def nothing(X, at, template, others, of_others):
    return DenseSynchronizer(P, pattern=template).fit(X).match(others).times


def anchored(std):
    """Dense matching with key-frames of this standard deviation."""

    def times(X, at, template, others, of_others):
        sync = DenseSynchronizer(P, pattern=template, keyframe_std=std)
        sync.fit(X, keyframes=own_frames(at, X))
        return sync.match(others, keyframes=own_frames(of_others, others)).times

    return times


def piecewise_linear(X, at, template, others, of_others):
    sync = LinearSynchronizer(P, pattern=template)
    sync.fit(X, keyframes=own_frames(at, X))
    return sync.match(others, keyframes=own_frames(of_others, others)).times


def in_pieces(X, at, template, others, of_others):
    """The part before the moment and the part after it, each matched by itself."""
    out = np.empty((len(others), P))
    for late in (False, True):
        pieces = [piece(x, moment, late) for x, moment in zip(X, at, strict=True)]
        moved = [piece(x, moment, late) for x, moment in zip(others, of_others, strict=True)]
        times = DenseSynchronizer(P, pattern=template).fit(pieces).match(moved).times
        for row, tau, moment in zip(out, times, of_others, strict=True):
            own, met = (ends(moment, late) for moment in (at[template], moment))
            inside = (own[0] <= FRAMES) & (own[1] >= FRAMES)
            share = (FRAMES[inside] - own[0]) / (own[1] - own[0]) * (P - 1)
            row[inside] = met[0] + np.interp(share, FRAMES, tau) / (P - 1) * (met[1] - met[0])
    return out


def ends(moment, late):
    return (moment, P - 1) if late else (0, moment)


def piece(x, moment, late):
    """The part of a clip before or after a moment, at as many frames as the clip has."""
    first, last = (k / (P - 1) * (len(x) - 1) for k in ends(moment, late))
    at = np.linspace(first, last, max(8, round(last - first) + 1))
    return np.stack([np.interp(at, np.arange(len(x)), column) for column in x.T], axis=1)


METHODS = {
    "nothing": nothing,
    "exact": anchored(0),
    "`keyframe_std=3`": anchored(3),
    "each piece by itself": in_pieces,
    "piecewise linear": piecewise_linear,
}


# -- what is judged -----------------------------------------------------------------------------


def cases(people, peers_only):
    """(one, given, judged) of every two moments of an action."""
    known = {(e.action, e.name) for e in EVENTS if e.peers}
    for one in people:
        for given in one.moments:
            for judged in one.moments:
                of_ruler = {(one.name, given), (one.name, judged)} <= known
                if given != judged and of_ruler == peers_only:
                    yield one, given, judged


def errors_to_templates(one, given, judged, method):
    """Errors of the other moment, and of the given one, to every template that shows both."""
    at, wanted = one.moments[given], one.moments[judged]
    seen = np.flatnonzero(np.isfinite(at + wanted))
    X, at, wanted = [one.X[i] for i in seen], at[seen], wanted[seen]
    out = []
    for template in range(len(seen)):
        if seen[template] in one.patterns:
            times = np.delete(method(X, at, template, X, at), template, axis=0)
            out.append(missed(times, template, at, wanted, np.arange(len(seen)) != template))
    return np.concatenate(out, axis=1)


def errors_of_others(one, given, judged, method):
    """The same of the clips of people that had no part in the fit."""
    at, wanted = one.moments[given], one.moments[judged]
    seen = np.flatnonzero(np.isfinite(at + wanted))
    postures, at, wanted = [one.postures[i] for i in seen], at[seen], wanted[seen]
    actors, out = np.asarray(one.actors)[seen], []
    for train, test in GroupKFold(min(FOLDS, len(set(actors)))).split(seen, groups=actors):
        space = ASpace().fit([postures[i] for i in train])
        points = space.transform(postures)
        known, others = [points[i] for i in train], [points[i] for i in test]
        for row, template in enumerate(train):
            if seen[template] in one.patterns:
                times = method(known, at[train], row, others, at[test])
                out.append(missed(times, template, at, wanted, test))
    return np.concatenate(out, axis=1)


def missed(times, template, at, wanted, rows):
    """Distances from the other moment and from the given one: (2, n_clips)."""
    return np.array(
        [
            np.abs([np.interp(x[template], FRAMES, tau) for tau in times] - x[rows])
            for x in (wanted, at)
        ]
    )


def geometric(cells):
    return np.exp(np.mean(np.log(np.asarray(cells) + FLOOR), axis=0))


def given_table(people, errors, peers_only):
    """A table of all cases and methods."""
    names = list(METHODS)
    print(f"| given | judged | pairs | {' | '.join(names)} |")
    print("|---|---|---|" + "---|" * len(names))
    rows, exact = {name: [] for name in names}, []
    hops = {name: [] for name in names}
    for one, given, judged in cases(people, peers_only):
        cells = []
        for name, method in METHODS.items():
            other, own = errors(one, given, judged, method)
            pair = np.mean(other), np.median(other)
            rows[name].append(pair)
            if "hop" in one.name:
                hops[name].append(pair)
            if name == "exact":
                exact.append(own.max())
            cells.append(f"{pair[0]:.2f} / {pair[1]:.2f}")
        title = f"{one.name}: {given}"
        print(f"| {title} | {judged} | {len(other)} | {' | '.join(cells)} |", flush=True)
    for title, of_all in (("geometric mean", rows), ("of hops", hops)):
        pairs = [geometric(of_all[name]) for name in names]
        cells = " | ".join(f"{mean:.2f} / {median:.2f}" for mean, median in pairs)
        print(f"| **{title}** | | | {cells} |")
    print(f"\nLargest distance from a key-frame that is exact: {max(exact):.1e} frames.\n")


def few_table(people):
    """A fifth of the clips have a moment: its error in the others, and without any key-frame."""
    print("| setting | mean | median | best | worst |\n|---|---|---|---|---|")
    for std in (0, 3):
        ratios = []
        for one in people:
            for at in one.moments.values():
                before, after = few_labels(one, at, std)
                pairs = [(np.mean(e), np.median(e)) for e in (before, after)]
                ratios.append(np.log(np.add(pairs[1], FLOOR) / np.add(pairs[0], FLOOR)))
        mean, median = np.exp(np.mean(ratios, axis=0))
        best, *_, worst = np.exp(np.sort(np.array(ratios)[:, 0]))
        name = f"`keyframe_std={std}`"
        print(f"| {name} | {mean:.3f} | {median:.3f} | {best:.2f} | {worst:.2f} |", flush=True)


def few_labels(one, at, std):
    seen, errors = np.flatnonzero(np.isfinite(at)), ([], [])
    for draw in range(DRAWS):
        rng = np.random.default_rng(draw)
        some = rng.permutation(seen)[: max(2, round(FEW * len(seen)))]
        labels = np.where(np.isin(np.arange(len(at)), some), at, np.nan)
        others = np.setdiff1d(seen, some)
        for template in some[:2]:
            for found, method in zip(errors, (nothing, anchored(std)), strict=True):
                times = method(one.X, labels, int(template), one.X, labels)[others]
                met = [np.interp(at[template], FRAMES, tau) for tau in times]
                found.extend(np.abs(met - at[others]))
    return errors


def wrong_table(people):
    """One given moment of five is wrong: errors of the other moment, of people not in the fit."""
    print("| given | mean | median |\n|---|---|---|")
    kinds = {"nothing": nothing, "exact": anchored(0), "`keyframe_std=3`": anchored(3)}
    for name, method in kinds.items():
        for is_wrong in (False, True) if name != "nothing" else (False,):
            rows = []
            for one, given, judged in cases(people, True):
                other, _ = errors_of_others(one, given, judged, mislabelled(method, is_wrong))
                rows.append((np.mean(other), np.median(other)))
            mean, median = geometric(rows)
            title = f"{name}, one of five wrong" if is_wrong else name
            print(f"| {title} | {mean:.2f} | {median:.2f} |", flush=True)


def mislabelled(method, is_wrong):
    """The method given moments of which every fifth is a tenth of the clip early or late."""

    def moved(at, seed):
        rng, at = np.random.default_rng(seed), np.array(at)
        some = rng.permutation(len(at))[: round(len(at) / 5)]
        at[some] += 0.1 * (P - 1) * rng.choice([-1, 1], len(some))
        return np.clip(at, 5, P - 6)

    def times(X, at, template, others, of_others):
        if is_wrong:
            at, of_others = moved(at, template), moved(of_others, template + 1000)
        return method(X, at, template, others, of_others)

    return times


def main():
    folder, *chosen = sys.argv[1:]
    people = read_people(folder)
    if not chosen or "given" in chosen:
        print("### Twelve cases\n")
        given_table(people, errors_to_templates, True)
        print("### The same, of people that had no part in the fit\n")
        given_table(people, errors_of_others, True)
        print("### Other moments of these and other actions\n")
        given_table(people, errors_to_templates, False)
    if not chosen or "few" in chosen:
        print("### A fifth of the clips has a key-frame: errors in the others, relative\n")
        few_table(people)
    if not chosen or "wrong" in chosen:
        print("\n### Wrong key-frames\n")
        wrong_table(people)


if __name__ == "__main__":
    main()
