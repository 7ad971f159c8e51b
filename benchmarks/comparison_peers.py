"""`compare_groups` beside other tests of curves of two groups, on made gait and on nlreg1d's data.

    pip install spm1d fdasrsf fdatools scikit-fda "multimethod<2"
    python benchmarks/comparison_peers.py [N_STUDIES [N_SLOW [TEST ...]]]
    python benchmarks/comparison_peers.py --data FOLDER

Two groups of 10 or 20 people in all, with two strides each: null strides of `make_gait`, and what
is made on top of them for group B. A warp of at most 2, 3 or 5 % of the cycle, around 20 % (early)
or 70 % (late); a bump of the knee of 5, 10 or 15 degrees; or both. The signals are the knee alone,
or all four. All tests have 5 %, and the means of people where they take one curve a person.
Registered are these means.

- compare_groups: signals are scaled for the match, 999 permutations. Shape and timing are what the
  clusters say, if the joint test rejects.
- spm1d: after linear normalisation, t of one signal. Of four, Hotelling's T2 of the angles and t of
  the force at 2.5 % each, because T2 does not exist where the force is 0.
- spm1d, each: t of each of four signals, with Bonferroni's correction.
- nlreg1d: its procedure, with fdasrsf and spm1d. Curves are registered by square-root slopes; T2 of
  registered curve and displacement; if it rejects, t of each at 2.5 %. By random field theory. Each
  of several signals is tested alone, with Bonferroni's correction.
- nlreg1d, permuted: the same with 999 permutations, post hoc at 5 %, as in its published figures.
- fdatools: its t test by 999 permutations after linear normalisation; *registered*: after its
  registration of all signals by least squares, of curves and of warps at half of the level each.
- scikit-fda: its analysis of variance after linear normalisation; *registered*: after its elastic
  registration, of curves and of warps at half of the level each. Both packages test each of
  several signals alone, with Bonferroni's correction.

Tests with a registration of others run on N_SLOW studies (20 by default; a third of them with four
signals) and the rest on N_STUDIES (100; twice as many where nothing differs); names of tests choose
some. Prints Markdown: a table of each difference as it comes, then all, first of fewer studies.
*Right*: of the studies in which a difference is found, those in which shape is called if and only
if it differs, and timing likewise. *Overlap*: intersection over union of the frames that are found,
in any signal, with those in which the true difference is above a quarter of its largest value; the
median where it is found. Seconds of *nlreg1d, permuted* are without the registration.

With ``--data`` prints answers to the data sets of nlreg1d (github.com/0todd0000/nlreg1d, folder
Data): those that it published, of its procedure, and of `compare_groups`.
"""

import os
import sys

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import contextlib
import io
import time
import warnings
from pathlib import Path

import numpy as np
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn_motionsync import DenseSynchronizer, FrameWise, compare_groups
from sklearn_motionsync.datasets import make_gait

P, KNEE, LEVEL, PERMUTATIONS = 101, 1, 0.05, 999
CLOCK = np.linspace(0, 1, P)
PEOPLE = (10, 20)
SETTINGS = {"knee": [KNEE], "four signals": [0, 1, 2, 3]}
_AT = {"early": 0.2, "late": 0.7}
# Largest warp in per cent of the cycle, height of the bump in degrees, and where.
DIFFERENCES = {
    "nothing": (0, 0, 0.2),
    **{f"timing {w} % {at}": (w, 0, c) for at, c in _AT.items() for w in (2, 3, 5)},
    **{f"shape {h} degrees {at}": (0, h, c) for at, c in _AT.items() for h in (5, 10, 15)},
    **{f"both {w} % and {h} degrees {at}": (w, h, c)
       for at, c in _AT.items() for w, h in ((3, 10), (5, 15))},
}  # fmt: skip
# Those of all four signals.
FEWER = [name for name in DIFFERENCES if not ("5 %" in name or name.startswith("shape 5 degrees"))]


# -- the made data ------------------------------------------------------------------------


def later(t, largest, centre):
    """How much later group B is at moments t, as a share of the cycle; smooth, 0 far away."""
    width = min(centre, 1 - centre)
    return largest / 100 * np.cos(np.pi / 2 * np.clip((t - centre) / width, -1, 1)) ** 2


def bump(t, height, centre):
    return height * np.exp(-(((t - centre) / 0.06) ** 2) / 2)


def made(seed, n_people, difference):
    """Trials, groups, people; and the frames in which shape and timing truly differ, or None."""
    warp, height, centre = DIFFERENCES[difference]
    gait = make_gait(n_people, 2, random_state=seed)
    trials = []
    for x, group in zip(gait.data, gait.group, strict=True):
        if group == "B":
            t = np.linspace(0, 1, len(x))
            x = x + bump(t, height, centre)[:, np.newaxis] * (np.arange(x.shape[1]) == KNEE)
            moments = t - later(t, warp, centre)  # what is shown at t was before shown then
            x = np.stack([np.interp(moments, t, column) for column in x.T], axis=1)
        trials.append(x)
    truth = {"shape": None, "timing": None}
    if height:
        truth["shape"] = bump(CLOCK, height, centre) > height / 4
    if warp:
        truth["timing"] = later(CLOCK, warp, centre) > warp / 400
    return trials, list(gait.group), list(gait.person), truth


def means_of_people(trials, groups, people):
    """Means of linearly normalised trials, group A first: (n_people, P, n_signals), and n of A."""
    curves = np.stack([
        np.stack([np.interp(CLOCK, np.linspace(0, 1, len(x)), column) for column in x.T], axis=1)
        for x in trials
    ])  # fmt: skip
    of = dict(zip(people, groups, strict=True))
    names = sorted(of, key=lambda name: of[name])
    means = [curves[[person == name for person in people]].mean(axis=0) for name in names]
    return np.stack(means), sum(of[name] == "A" for name in names)


# -- the tests ----------------------------------------------------------------------------
# Each takes trials, groups and people, and gives joint, shape and timing (None if it does not
# tell them apart), and masks of the frames found, (P,), or None.


def answer(joint, shape=None, timing=None):
    """From masks, answers, or None."""
    masks = [mask if isinstance(mask, np.ndarray) else None for mask in (shape, timing)]
    calls = [None if call is None else bool(np.any(call)) for call in (shape, timing)]
    return dict(zip(("joint", "shape", "timing", "shape_mask", "timing_mask"),
                    (bool(joint), *calls, *masks), strict=True))  # fmt: skip


def ours(trials, groups, people):
    pipe = make_pipeline(FrameWise(StandardScaler()), DenseSynchronizer(P)).fit(trials)
    found = compare_groups(pipe, trials, groups, people=people, n_permutations=PERMUTATIONS)
    masks = {what: np.zeros(P, dtype=bool) for what in ("shape", "timing")}
    if found.p_joint <= LEVEL:
        for row in found.clusters.itertuples():
            masks[row.what][round(row.start) : round(row.end) + 1] = True
    return answer(found.p_joint <= LEVEL, **masks)


def varying(y, n):
    """Frames in which curves (n_people, P) vary in both groups: the force is 0 in swing."""
    spread = np.minimum(y[:n].std(axis=0), y[n:].std(axis=0))
    return spread > 1e-6 * spread.max()


def spm1d_t(y, n, level):
    import spm1d

    kept = varying(y, n)
    return spm1d.stats.ttest2(y[:n, kept], y[n:, kept]).inference(level, two_tailed=True).h0reject


def spm1d_linear(trials, groups, people):
    import spm1d

    y, n = means_of_people(trials, groups, people)
    if y.shape[2] == 1:
        return answer(spm1d_t(y[:, :, 0], n, LEVEL))
    a, b = y[:n, :, :3], y[n:, :, :3]
    angles = spm1d.stats.hotellings2(a, b).inference(LEVEL / 2).h0reject
    return answer(angles or spm1d_t(y[:, :, 3], n, LEVEL / 2))


def spm1d_each(trials, groups, people):
    y, n = means_of_people(trials, groups, people)
    return answer(any(spm1d_t(x, n, LEVEL / y.shape[2]) for x in np.moveaxis(y, 2, 0)))


def srsf(y):
    """Registered curves and displacements, (n, P) both, without the first and last frame."""
    import fdasrsf

    clock = np.linspace(0, 1, y.shape[1])
    with contextlib.redirect_stdout(io.StringIO()):
        registration = fdasrsf.fdawarp(y.T, clock)
        registration.srsf_align(MaxItr=5, verbose=False)
    # A frame of the template is at gam(t) of the curve. The displacement tells, at the frames of
    # the curve, how much later they are than in the template.
    displacement = np.stack([clock - np.interp(clock, g, clock) for g in registration.gam.T])
    return registration.fn.T[:, 1:-1], displacement[:, 1:-1]


_LAST = [None, None]


def registered(trials, groups, people):
    """For each signal the two fields of nlreg1d; remembered, for the two ways to test them."""
    if _LAST[0] is not trials:
        y, n = means_of_people(trials, groups, people)
        _LAST[:] = trials, ([srsf(x) for x in np.moveaxis(y, 2, 0)], n)
    return _LAST[1]


def nlreg1d(trials, groups, people):
    fields, n = registered(trials, groups, people)
    return joined([nlreg1d_test(*pair, n, LEVEL / len(fields)) for pair in fields])


def nlreg1d_permuted(trials, groups, people):
    fields, n = registered(trials, groups, people)
    return joined([nlreg1d_permute(*pair, n, LEVEL / len(fields)) for pair in fields])


def joined(answers):
    """Of several signals: rejects, and frames of shape and timing in any."""
    rejects, shape, timing = zip(*answers, strict=True)
    return answer(any(rejects), np.any(shape, axis=0), np.any(timing, axis=0))


def nlreg1d_test(curves, displacement, n, level, paired=False):
    """By random field theory: whether T2 rejects, and the frames that post hoc t rejects."""
    import spm1d

    masks, fields = np.zeros((2, curves.shape[1] + 2), dtype=bool), (curves, displacement)
    kept = varying(curves, n) & varying(displacement, n)
    both = np.stack(fields, axis=2)[:, kept]
    if paired:
        t2, t = spm1d.stats.hotellings_paired, spm1d.stats.ttest_paired
    else:
        t2, t = spm1d.stats.hotellings2, spm1d.stats.ttest2
    rejects = t2(both[n:], both[:n]).inference(level).h0reject
    if rejects:
        for mask, field in zip(masks, fields, strict=True):
            kept = varying(field, n)
            found = t(field[n:, kept], field[:n, kept]).inference(level / 2, two_tailed=True)
            mask[1 + np.flatnonzero(kept)] = np.abs(found.z) > found.zstar
    return rejects, *masks


def nlreg1d_permute(curves, displacement, n, level, paired=False):
    """The same by permutations of the largest values; post hoc at the level, as published."""
    rng, m = np.random.default_rng(0), len(curves)
    fields = np.stack([curves, displacement], axis=2)
    kept = varying(curves, n) & varying(displacement, n)
    scale = fields[:, kept].std(axis=0)
    z = fields[:, kept] / scale
    values = {"t2": [], 0: [], 1: []}
    for k in range(PERMUTATIONS + 1):
        if paired:
            signs = rng.choice([-1.0, 1.0], size=n) if k else np.ones(n)
            d = signs[:, np.newaxis, np.newaxis] * (z[n:] - z[:n])
            mean, residual, df, weight = d.mean(axis=0), d - d.mean(axis=0), n - 1, n
        else:
            y = z[rng.permutation(m)] if k else z
            a, b = y[:n], y[n:]
            mean = b.mean(axis=0) - a.mean(axis=0)
            residual = np.concatenate([a - a.mean(axis=0), b - b.mean(axis=0)])
            df, weight = m - 2, n * (m - n) / m
        (v0, v1), c = np.square(residual).sum(axis=0).T / df, residual.prod(axis=2).sum(axis=0) / df
        m0, m1 = mean.T
        t2 = weight * (m0**2 * v1 - 2 * m0 * m1 * c + m1**2 * v0) / (v0 * v1 - c**2)
        for name, value in (("t2", t2), (0, weight * m0**2 / v0), (1, weight * m1**2 / v1)):
            values[name].append(value.max())
            if not k:
                values[name, "field"] = value
    rejects = np.mean(np.array(values["t2"]) >= values["t2"][0]) <= level
    masks = np.zeros((2, curves.shape[1] + 2), dtype=bool)
    if rejects:
        for k in (0, 1):
            masks[k][1 + np.flatnonzero(kept)] = (
                np.mean(np.array(values[k])[:, np.newaxis] >= values[k, "field"], axis=0) <= level
            )
    return rejects, *masks


def fdatools_p(y, n):
    """p of curves (n, P)."""
    import fdatools

    basis = fdatools.BSpline((0.0, 1.0), 30)
    fds = [fdatools.smooth(x.T, CLOCK, basis=basis, lam=1e-8).fd for x in (y[:n], y[n:])]
    return fdatools.stats.t_test(*fds, n_perm=PERMUTATIONS, random_state=0).pvalue


def fdatools_linear(trials, groups, people):
    y, n = means_of_people(trials, groups, people)
    return answer(min(fdatools_p(x, n) for x in np.moveaxis(y, 2, 0)) <= LEVEL / y.shape[2])


def fdatools_registered(trials, groups, people):
    import fdatools

    y, n = means_of_people(trials, groups, people)
    scaled = (y - y.mean(axis=(0, 1))) / y.std(axis=(0, 1))
    basis, warps = fdatools.BSpline((0.0, 1.0), 30), fdatools.BSpline((0.0, 1.0), 8)
    fds = [fdatools.smooth(x.T, CLOCK, basis=basis, lam=1e-8).fd for x in np.moveaxis(scaled, 2, 0)]
    coefs = fds[0].coefs if len(fds) == 1 else np.stack([fd.coefs for fd in fds], axis=2)
    options = {"criterion": "least_squares", "warp_basis": warps, "lam": 1e-4}
    result = fdatools.register(fdatools.FData(coefs, basis), max_iter=30, tol=1e-6, **options)
    # A frame of the template is at warp(t) of the curve.
    moments = np.asarray(result.warp_values(CLOCK)).T
    curves = [
        np.stack([np.interp(at, CLOCK, x) for at, x in zip(moments, own, strict=True)])
        for own in np.moveaxis(y, 2, 0)
    ]
    shape = min(fdatools_p(x, n) for x in curves) <= LEVEL / 2 / len(curves)
    timing = fdatools_p(moments - CLOCK, n) <= LEVEL / 2
    return answer(shape or timing, shape, timing)


def skfda_p(y, n):
    from skfda import FDataGrid
    from skfda.inference.anova import oneway_anova

    fds = [FDataGrid(x, CLOCK) for x in (y[:n], y[n:])]
    return oneway_anova(*fds, n_reps=PERMUTATIONS, random_state=0)[1]


def skfda_linear(trials, groups, people):
    y, n = means_of_people(trials, groups, people)
    return answer(min(skfda_p(x, n) for x in np.moveaxis(y, 2, 0)) <= LEVEL / y.shape[2])


def skfda_registered(trials, groups, people):
    from skfda import FDataGrid
    from skfda.preprocessing.registration import FisherRaoElasticRegistration

    y, n = means_of_people(trials, groups, people)
    p = {"shape": [], "timing": []}
    for x in np.moveaxis(y, 2, 0):
        registration = FisherRaoElasticRegistration()
        curves = registration.fit_transform(FDataGrid(x, CLOCK)).data_matrix[..., 0]
        p["shape"].append(skfda_p(curves, n))
        p["timing"].append(skfda_p(registration.warping_.data_matrix[..., 0] - CLOCK, n))
    shape, timing = (min(values) <= LEVEL / 2 / y.shape[2] for values in p.values())
    return answer(shape or timing, shape, timing)


TESTS = {
    "compare_groups": ours,
    "spm1d": spm1d_linear,
    "spm1d, each": spm1d_each,
    "nlreg1d": nlreg1d,
    "nlreg1d, permuted": nlreg1d_permuted,
    "fdatools": fdatools_linear,
    "fdatools, registered": fdatools_registered,
    "scikit-fda": skfda_linear,
    "scikit-fda, registered": skfda_registered,
}
SLOW = {"nlreg1d", "nlreg1d, permuted", "fdatools, registered", "scikit-fda, registered"}


# -- studies ------------------------------------------------------------------------------


def study(seed, n_people, difference, signals, names):
    """For each test its answer, with seconds, whether it is right, and overlaps."""
    trials, groups, people, truth = made(seed, n_people, difference)
    trials, rows = [x[:, signals] for x in trials], {}
    for name in names:
        begin = time.perf_counter()
        row = TESTS[name](trials, groups, people)
        row["seconds"] = time.perf_counter() - begin
        if row["joint"] and row["shape"] is not None:
            row["right"] = all(row[what] == (truth[what] is not None) for what in truth)
        for what, mask in truth.items():
            found = row[f"{what}_mask"]
            if mask is not None and found is not None and found.any():
                row[f"{what} overlap"] = (found & mask).sum() / (found | mask).sum()
        rows[name] = row
    return rows


def study_more(rows, n_studies, n_slow, *given, names):
    """Add studies to the rows of each test, up to these numbers."""
    for seed in range(max(n_studies, n_slow)):
        due = [name for name in names if seed < (n_slow if name in SLOW else n_studies)]
        due = [name for name in due if seed >= len(rows[name])]
        if due:
            for name, row in study(seed, *given, due).items():
                rows[name].append(row)


def summary(rows):
    """Columns of the tables, of the studies of one test."""
    columns = {"n": len(rows)}
    for key in ("joint", "shape", "timing", "right"):
        values = [row[key] for row in rows if row.get(key) is not None]
        columns[key] = 100 * np.mean(values) if values else np.nan
    for key in ("shape overlap", "timing overlap", "seconds"):
        values = [row[key] for row in rows if key in row]
        columns[key] = np.median(values) if values else np.nan
    return columns


def shown(value, digits=0):
    return "-" if np.isnan(value) else f"{value:.{digits}f}"


def head(*names):
    print("\n| " + " | ".join(names) + " |\n" + "|---" * len(names) + "|")


def show_cell(title, found):
    print(f"\n{title}")
    head("test", "n", "joint", "shape", "timing", "right", "overlap: shape", "timing", "seconds")
    for name, row in found.items():
        cells = [shown(row[key]) for key in ("joint", "shape", "timing", "right")]
        cells += [shown(row[f"{what} overlap"], 2) for what in ("shape", "timing")]
        print(f"| {name} | {row['n']} | " + " | ".join(cells) + f" | {row['seconds']:.2f} |")
    sys.stdout.flush()


def show_all(found, names):
    """Tables over all differences; found by (setting, n_people, difference) and test."""
    calling = [n for n in names if any(not np.isnan(row[n]["shape"]) for row in found.values())]
    kinds = {"joint": names, "right": calling, "shape overlap": calling, "timing overlap": calling}
    titles = {"joint": "Per cent in which a difference is found", "right": "Right, of these"}
    for setting in SETTINGS:
        for n_people in PEOPLE:
            rows = [
                (row, cell[2]) for cell, row in found.items() if cell[:2] == (setting, n_people)
            ]
            show_cell(f"**{setting}, {n_people} people. Per cent, nothing differs**", rows[0][0])
            for key, columns in kinds.items():
                print(f"\n**{setting}, {n_people} people. {titles.get(key, key.capitalize())}**")
                head("differs by", *columns)
                for row, difference in rows:
                    cells = [shown(row[n][key], 2 * ("overlap" in key)) for n in columns]
                    print(f"| {difference} | " + " | ".join(cells) + " |")
            seconds = {n: np.median([row[n]["seconds"] for row, _ in rows]) for n in names}
            print("\nSeconds: " + ", ".join(f"{name} {s:.2f}" for name, s in seconds.items()))
            print("Studies: " + ", ".join(f"{name} {rows[-1][0][name]['n']}" for name in names))
    sys.stdout.flush()


def main(arguments):
    numbers = [int(x) for x in arguments if x.isdigit()]
    n_studies, n_slow = [*numbers, *(100, 20)[len(numbers) :]]
    names = [x for x in arguments if not x.isdigit()] or list(TESTS)
    cells = [
        (setting, n_people, difference)
        for setting in SETTINGS
        for n_people in PEOPLE
        for difference in (DIFFERENCES if setting == "knee" else FEWER)
    ]
    rows = {cell: {name: [] for name in names} for cell in cells}
    for share, slow_share in ((0.2, 0.5), (1, 1)):
        found = {}
        for cell in cells:
            setting, n_people, difference = cell
            n = round(share * n_studies) * (1 if difference != "nothing" or share < 1 else 2)
            slow = round(slow_share * n_slow / (1 if setting == "knee" else 3))
            given = n_people, difference, SETTINGS[setting]
            study_more(rows[cell], n, slow, *given, names=names)
            found[cell] = {name: summary(x) for name, x in rows[cell].items() if x}
            show_cell(f"{setting}, {n_people} people, {difference}", found[cell])
        show_all(found, names)


# -- the data sets of nlreg1d --------------------------------------------------------------

# What the figures of its repository say, by 1000 permutations; in per cent.
PUBLISHED = {
    "SimulatedA": "shape 35-62; not timing; not linear",
    "SimulatedB": "timing 32-63; not shape; linear 32-48",
    "Besier2009-vastus": "timing 15-30; not shape; not linear",
    "Pataky2014-mediolateral": "timing 54-89, 16-20; not shape; linear 65-82",
}


def stretches(mask):
    """Of frames, in per cent, as text."""
    edges = np.flatnonzero(np.diff(np.r_[0, mask.astype(int), 0])).reshape(-1, 2)
    scale = 100 / (len(mask) - 1)
    return ", ".join(f"{scale * a:.0f}-{scale * (b - 1):.0f}" for a, b in edges) or "not"


def show_ours(sync, X, *groups, **given):
    """Print the answer of `compare_groups`, with its clusters."""
    found = compare_groups(sync, X, *groups, n_permutations=9999, **given)
    print(f"- compare_groups: {found.describe()} Linear p = {found.p_linear:.4f}.")
    for row in found.clusters.itertuples():
        interval = f"{row.size:.3g} ({row.lower:.3g} to {row.upper:.3g})"
        print(f"  - {row.what} {row.start:.0f}-{row.end:.0f}, p = {row.p:.4f}, {interval}")


def published(folder):
    """Answers to each set, beside the published ones."""
    for path in sorted(Path(folder).glob("*.csv")):
        table = np.loadtxt(path, delimiter=",")
        table = table[np.argsort(table[:, 0], kind="stable")]
        groups, curves = table[:, 0].astype(int).tolist(), table[:, 1:]
        n, X = groups.count(0), list(curves[:, :, np.newaxis])
        paired = path.stem.startswith("Pataky")
        given = {"people": [*range(n)] * 2, "paired": True} if paired else {}
        print(f"\n**{path.stem}**, {len(X)} curves\n")
        print(f"- published: {PUBLISHED.get(path.stem, 'nothing')}")
        fields = srsf(curves)
        for name, test in (("", nlreg1d_test), (", permuted", nlreg1d_permute)):
            rejects, shape, timing = test(*fields, n, LEVEL, paired=paired)
            words = (
                f"shape {stretches(shape)}; timing {stretches(timing)}" if rejects else "nothing"
            )
            print(f"- nlreg1d{name}, with fdasrsf of today: {words}")
        show_ours(DenseSynchronizer(P).fit(X), X, groups, **given)
    path = Path(folder) / "Dorn2021-reduced.npz"
    with np.load(path, allow_pickle=True) as archive:
        X, speed = [np.asarray(x, float)[:, np.newaxis] for x in archive["y"]], archive["speed"]
    print(f"\n**{path.stem}**, {len(X)} curves of {[len(x) for x in X]} frames at {speed}\n")
    print(f"- published: {PUBLISHED.get(path.stem, 'nothing')}")
    show_ours(DenseSynchronizer(P).fit(X), X, covariate=speed.astype(float))


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    if "--data" in sys.argv:
        published(sys.argv[sys.argv.index("--data") + 1])
    else:
        main(sys.argv[1:])
