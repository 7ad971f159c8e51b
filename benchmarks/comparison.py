"""Whether `compare_groups` keeps its level, and what it finds, beside other tests of curves.

    pip install spm1d fdasrsf fdatools
    python benchmarks/comparison.py DATA_FOLDER [level] [unequal] [designs] [power] [covariate]
        [peers] [nlreg1d] [--studies N]

*Level*: studies in which nothing differs, of 8 to 30 people of `make_gait` with two strides, one to
four signals, groups, pairs or a covariate drawn at random; and of people drawn from the forces of a
muscle (nlreg1d), in groups at random. Signals are scaled for the match and compared in their units,
by 199 permutations at 5 %. *Unequal*: controls and patients whose smooth curves of one signal have
so many times their spread, in all frames or in the second half; a bump of patients is so high.
*Designs*: the effects of `compare_effects` in such curves, three conditions, groups and conditions,
and two factors with an age that group 1 exceeds; and how often `bands` hold a bump at all times.
*Power*: differences that `make_gait`
makes between 10 or 20 people of two strides, four signals, by 399 permutations. In per cent.
*Covariate*: an event that moves by 2 % of the trial with a standard deviation of the covariate
between 12 people, who vary by 2 %, their trials by 1 %; means of people, and slopes within them.

*Peers*: null strides of 20 people, and what is made on top of them for group B: a warp of at most 2
or 3 % of the cycle, around 20 % (early) or 70 % (late); a bump of the knee of 5 or 10 degrees; or
both. The signals are the knee alone, or, without registration by others, all four. All tests have
5 %, and the means of people where they take one curve a person.

- compare_groups: signals are scaled for the match, 999 permutations.
- spm1d: after linear normalisation, t of one signal. Of four, Hotelling's T2 of the angles and t of
  the force at 2.5 % each, because T2 does not exist where the force is 0.
- nlreg1d: its procedure, with fdasrsf and spm1d. Curves are registered by square-root slopes; T2 of
  registered curve and displacement; if it rejects, t of each at 2.5 %. By random field theory.
- fdatools: its t test by 999 permutations after its registration by least squares, of curves and of
  warps at half of the level each.

*Right*: of the studies in which a difference is found, those in which shape is called if and only
if it differs, and timing likewise. *Overlap*: intersection over union of the frames that are found,
in any signal, with those in which the true difference is above a quarter of its largest value; the
median where it is found. *Nlreg1d*: answers to its data sets (github.com/0todd0000/nlreg1d, folder
Data). Prints Markdown.
"""

import contextlib
import io
import warnings
from functools import partial
from itertools import product

import numpy as np
import pandas as pd
from harness import at_frames, command_line, percent, print_head, print_row, run_tables
from joblib import Parallel, delayed
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn_motionsync import DenseSynchronizer, FrameWise, LinearSynchronizer
from sklearn_motionsync.comparison import compare_effects, compare_events, compare_groups
from sklearn_motionsync.datasets import make_gait

P, KNEE, LEVEL, PERMUTATIONS = 101, 1, 0.05, 999
MADE = {
    "timing, 2 %": {"timing": 2},
    "timing, 3 %": {"timing": 3},
    "shape, 8 degrees": {"amplitude": 8},
    "shape, 15 degrees": {"amplitude": 15},
}
ANSWERS = ("joint", "shape", "timing", "linear")


def compared(gait, kind, rng):
    """Arguments of `compare_groups`: what is compared."""
    persons = list(dict.fromkeys(gait.person))
    if kind == "two":
        return {"y": gait.group}
    if kind == "three":
        of = dict(zip(persons, rng.permutation(np.arange(len(persons)) % 3).tolist(), strict=True))
        return {"y": [of[person] for person in gait.person]}
    if kind == "paired":
        flips = dict(zip(persons, rng.integers(2, size=len(persons)).tolist(), strict=True))
        second = [k % 2 for k in range(len(gait.person))]
        pairs = zip(second, gait.person, strict=True)
        return {"y": [k ^ flips[person] for k, person in pairs], "paired": True}
    if kind == "within":
        return {"y": rng.normal(size=len(gait.person)), "covariate": True}
    of = dict(zip(persons, rng.normal(size=len(persons)).tolist(), strict=True))
    return {"y": [of[person] for person in gait.person], "covariate": True}


def null_study(seed):
    """Answers of each design, for a set in which nothing differs."""
    warnings.simplefilter("ignore")
    rng = np.random.default_rng(seed)
    n_people, signals = rng.choice([8, 10, 14, 20, 30]), rng.permutation(4)[: rng.integers(1, 5)]
    gait = make_gait(n_people, 2, random_state=seed)
    data = [x[:, signals] for x in gait.data]
    pipe = make_pipeline(FrameWise(StandardScaler()), DenseSynchronizer(P)).fit(data)
    given, rows = {"groups": gait.person, "n_permutations": 199, "random_state": seed}, []
    for kind in ("two", "three", "paired", "covariate", "within"):
        found = compare_groups(pipe, data, **compared(gait, kind, rng), **given)
        rows.append(found.to_frame()["differs"].tolist())
    return rows


T = np.linspace(0, 1, 51)
BUMP = np.exp(-0.5 * ((T - 0.5) / 0.1) ** 2)


def smooth_curves(rng, n):
    """Curves (n, 51) of variance 1."""
    covariance = np.exp(-0.5 * ((T - T[:, np.newaxis]) / 0.12) ** 2)
    return rng.standard_normal((n, 51)) @ np.linalg.cholesky(covariance + 1e-6 * np.eye(51)).T


def unequal_study(seed, n_controls, n_patients, spread, height):
    """Whether controls and patients are called different."""
    X = smooth_curves(np.random.default_rng(seed), n_controls + n_patients)
    X[n_controls:] *= spread
    X[n_controls:] += height * BUMP
    y = [0] * n_controls + [1] * n_patients
    sync = LinearSynchronizer(51).fit(X)
    found = compare_groups(sync, X, y, n_permutations=199, random_state=seed)
    return found.p_joint <= LEVEL


DESIGNS = {"condition": 3, "group * condition": 3, "group * sex + age": 1}


def design_study(seed, formula, n_people, spread):
    """Which effects that are not there are found, and whether the bands of groups hold a bump."""
    rng, n_trials = np.random.default_rng(seed), DESIGNS[formula]
    person, k = np.divmod(np.arange(n_people * n_trials), n_trials)
    # With another spread a quarter of the people, or the third condition, has it.
    group = person % 2 if spread == 1 else 1 * (person >= 3 * n_people // 4)
    data = {"condition": np.array([*"abc"])[k], "group": np.array([*"xy"])[group]}
    data["sex"] = np.array([*"fm"])[person // 2 % 2]
    data["age"] = (rng.standard_normal(n_people) + group[::n_trials])[person]
    scale = np.where((k == 2) if formula == "condition" else (group == 1), spread, 1)
    X = smooth_curves(rng, n_people)[person] + smooth_curves(rng, len(person))
    X *= scale[:, np.newaxis]
    given = {"groups": person, "n_permutations": 199, "random_state": seed}
    effects = compare_effects(LinearSynchronizer(51).fit(X), X, data, formula, **given)
    X += 1.5 * BUMP * (group[:, np.newaxis])
    held = compare_groups(LinearSynchronizer(51).fit(X), X, data["group"], **given).bands
    held = held[held["what"] == "shape"]
    inside = held["lower"].le(1.5 * BUMP) & held["upper"].ge(1.5 * BUMP)
    found = {name: effect.p_shape <= LEVEL for name, effect in effects.items()}
    return found | {"bands of groups": inside.all()}


def power_study(seed, n_people, params):
    """Whether each answer is given, of one study of two groups that differ."""
    warnings.simplefilter("ignore")
    gait = make_gait(n_people, 2, random_state=seed, **params)
    pipe = make_pipeline(FrameWise(StandardScaler()), DenseSynchronizer(P)).fit(gait.data)
    options = {"groups": gait.person, "n_permutations": 399, "random_state": seed}
    found = compare_groups(pipe, gait.data, gait.group, **options)
    return found.to_frame()["differs"].tolist()


def null_study_of_forces(seed, curves):
    """The same of real curves, one a person."""
    warnings.simplefilter("ignore")
    rng = np.random.default_rng(seed)
    n = rng.choice([8, 10, 14, 20, 30])
    X = list(curves[rng.permutation(len(curves))[:n], :, np.newaxis])
    sync, rows = DenseSynchronizer(P).fit(X), []
    three, age = (np.arange(n) % 3).tolist(), rng.normal(size=n)
    for design in ({"y": ["A", "B"] * (n // 2)}, {"y": three}, {"y": age, "covariate": True}):
        found = compare_groups(sync, X, **design, n_permutations=199, random_state=seed)
        rows.append(found.to_frame()["differs"].tolist())
    return rows


def covariate_study(seed, n_trials, spread):
    """Whether a regression on means of 12 people finds an effect, and slopes within them."""
    warnings.simplefilter("ignore")
    rng, people = np.random.default_rng(seed), np.repeat(np.arange(12), n_trials)
    of_people = rng.normal(size=12)[people]
    y = of_people + spread * rng.normal(size=len(people))
    events = 50 + 2 * y + 2 * rng.normal(size=12)[people] + rng.normal(size=len(people))
    means = np.bincount(people, y)[people] / n_trials
    given = {"groups": people, "covariate": True, "n_permutations": 399, "random_state": seed}
    trials = [np.zeros((101, 1))] * len(people)
    return [
        compare_events(trials, events[:, np.newaxis], values, **given)["differs"].item()
        for values in (means, y - means)
    ]


# -- beside others ----------------------------------------------------------------------

CLOCK = np.linspace(0, 1, P)
SETTINGS = {"knee": [KNEE], "four signals": [0, 1, 2, 3]}
AT = {"early": 0.2, "late": 0.7}
# Largest warp in per cent of the cycle, height of the bump in degrees, and where.
DIFFERENCES = {"nothing": (0, 0, 0.2)}
for _at, _centre in AT.items():
    DIFFERENCES |= {f"timing {w} % {_at}": (w, 0, _centre) for w in (2, 3)}
    DIFFERENCES |= {f"shape {h} degrees {_at}": (0, h, _centre) for h in (5, 10)}
    DIFFERENCES[f"both 3 % and 10 degrees {_at}"] = (3, 10, _centre)


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
            x = at_frames(x, (len(x) - 1) * moments)
        trials.append(x)
    truth = {"shape": None, "timing": None}
    if height:
        truth["shape"] = bump(CLOCK, height, centre) > height / 4
    if warp:
        truth["timing"] = later(CLOCK, warp, centre) > warp / 400
    return trials, list(gait.group), list(gait.person), truth


def means_of_people(trials, groups, people):
    """Means of linearly normalised trials, group A first: (n_people, P, n_signals), and n of A."""
    curves = LinearSynchronizer(P).fit_transform(trials)
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
    found = compare_groups(pipe, trials, groups, groups=people, n_permutations=PERMUTATIONS)
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


def srsf(y):
    """Registered curves and displacements, (n, P) both, without the first and last frame."""
    import fdasrsf

    clock = np.linspace(0, 1, y.shape[1])
    with contextlib.redirect_stdout(io.StringIO()):
        registration = fdasrsf.fdawarp(y.T, clock)
        registration.srsf_align(MaxItr=5, verbose=False)
    # A frame of the pattern is at gam(t) of the curve. The displacement tells, at the frames of
    # the curve, how much later they are than in the pattern.
    displacement = np.stack([clock - np.interp(clock, g, clock) for g in registration.gam.T])
    return registration.fn.T[:, 1:-1], displacement[:, 1:-1]


def nlreg1d(trials, groups, people):
    y, n = means_of_people(trials, groups, people)
    return answer(*nlreg1d_test(*srsf(y[:, :, 0]), n))


def nlreg1d_test(curves, displacement, n, paired=False):
    """By random field theory: whether T2 rejects, and the frames that post hoc t rejects."""
    import spm1d

    masks, fields = np.zeros((2, curves.shape[1] + 2), dtype=bool), (curves, displacement)
    kept = varying(curves, n) & varying(displacement, n)
    both = np.stack(fields, axis=2)[:, kept]
    if paired:
        t2, t = spm1d.stats.hotellings_paired, spm1d.stats.ttest_paired
    else:
        t2, t = spm1d.stats.hotellings2, spm1d.stats.ttest2
    rejects = t2(both[n:], both[:n]).inference(LEVEL).h0reject
    if rejects:
        for mask, field in zip(masks, fields, strict=True):
            kept = varying(field, n)
            found = t(field[n:, kept], field[:n, kept]).inference(LEVEL / 2, two_tailed=True)
            mask[1 + np.flatnonzero(kept)] = np.abs(found.z) > found.zstar
    return rejects, *masks


def smoothed(y):
    """Curves (n, P) as functions of fdatools."""
    import fdatools

    return fdatools.smooth(y.T, CLOCK, basis=fdatools.BSpline((0.0, 1.0), 30), lam=1e-8).fd


def fdatools_rejects(y, n):
    """Of curves (n, P), at half of the level."""
    import fdatools

    pair = smoothed(y[:n]), smoothed(y[n:])
    found = fdatools.stats.t_test(*pair, n_perm=PERMUTATIONS, random_state=0)
    return found.pvalue <= LEVEL / 2


def fdatools_registered(trials, groups, people):
    import fdatools

    y, n = means_of_people(trials, groups, people)
    y = y[:, :, 0]
    options = {"criterion": "least_squares", "warp_basis": fdatools.BSpline((0.0, 1.0), 8)}
    scaled = smoothed((y - y.mean()) / y.std())
    result = fdatools.register(scaled, max_iter=30, tol=1e-6, lam=1e-4, **options)
    # A frame of the pattern is at warp(t) of the curve.
    moments = np.asarray(result.warp_values(CLOCK)).T
    curves = np.stack([np.interp(at, CLOCK, x) for at, x in zip(moments, y, strict=True)])
    shape, timing = fdatools_rejects(curves, n), fdatools_rejects(moments - CLOCK, n)
    return answer(shape or timing, shape, timing)


TESTS = {"compare_groups": ours, "spm1d": spm1d_linear}
REGISTERED = {"nlreg1d": nlreg1d, "fdatools": fdatools_registered}


# -- studies ------------------------------------------------------------------------------


def peer_study(seed, difference, signals, test):
    """The answer of a test, whether it is right, and overlaps."""
    trials, groups, people, truth = made(seed, 20, difference)
    row = test([x[:, signals] for x in trials], groups, people)
    if row["joint"] and row["shape"] is not None:
        row["right"] = all(row[what] == (truth[what] is not None) for what in truth)
    for what, mask in truth.items():
        found = row[f"{what}_mask"]
        if mask is not None and found is not None and found.any():
            row[f"{what} overlap"] = (found & mask).sum() / (found | mask).sum()
    return row


# -- tables -----------------------------------------------------------------------------


def level_table(folder, n_studies=1000):
    """How often each answer is given where nothing differs."""
    kinds = ["two groups", "three groups", "paired", "covariate", "covariate within people"]
    table = np.loadtxt(folder / "nlreg1d" / "Besier2009-vastus.csv", delimiter=",")
    print_head(f"nothing differs, {n_studies} studies", ANSWERS)
    for prefix, names, function in (
        ("", kinds, null_study),
        ("forces, ", kinds[:2] + kinds[3:4], partial(null_study_of_forces, curves=table[:, 1:])),
    ):
        answers = Parallel(2)(delayed(function)(seed) for seed in range(n_studies))
        for name, shares in zip(names, 100 * np.mean(answers, axis=0), strict=True):
            print_row(prefix + name, [f"{x:.1f}" for x in shares])


def unequal_table(folder, n_studies=300):
    """How often groups that vary differently are called different."""
    print_head("controls, patients, spread, height of a bump", [f"differ in {n_studies} studies"])
    in_half = np.where(np.arange(51) < 25, 1, 3)
    for n, spread, height in product(((15, 5), (10, 10), (5, 15)), (1, 1.4, 3, in_half), (0, 1.4)):
        work = (delayed(unequal_study)(seed, *n, spread, height) for seed in range(n_studies))
        name = "3 in half" if spread is in_half else f"{spread:g}"
        print_row(f"{n[0]}, {n[1]}, {name}, {height:g}", [percent(np.mean(Parallel(2)(work)))])


def designs_table(folder, n_studies=300):
    """How often effects are found that are not there, and how often bands hold a difference."""
    for formula, n_people, spread in product(DESIGNS, (12, 20), (1, 3)):
        work = (delayed(design_study)(k, formula, n_people, spread) for k in range(n_studies))
        shares = 100 * pd.DataFrame(Parallel(2)(work)).mean()
        print_head(f"{formula}, {n_people} people, spread {spread}", shares.index)
        print_row("found in %", [f"{x:.1f}" for x in shares])


def power_table(folder, n_studies=300):
    """How often each answer is given where groups differ."""
    print_head("people, they differ by", ANSWERS)
    for n_people in (10, 20):
        for name, params in MADE.items():
            work = (delayed(power_study)(seed, n_people, params) for seed in range(n_studies))
            shares = 100 * np.mean(Parallel(2)(work), axis=0)
            print_row(f"{n_people}, {name}", [f"{x:.1f}" for x in shares])


def covariate_table(folder, n_studies=300):
    """How often an effect is found where a covariate differs between people and within them."""
    print_head("trials a person, spread within people", ["means of people", "slopes within them"])
    for n_trials in (2, 3, 5, 10):
        for spread in (0.1, 0.2, 0.5):
            work = (delayed(covariate_study)(seed, n_trials, spread) for seed in range(n_studies))
            shares = 100 * np.mean(Parallel(2)(work), axis=0)
            print_row(f"{n_trials}, {spread:g}", [f"{x:.0f}" for x in shares])


def peer_table(folder, n_studies=30):
    columns = ["joint", "shape", "timing", "right", "overlap: shape", "timing"]
    for setting, signals in SETTINGS.items():
        for difference in DIFFERENCES:
            print_head(f"{setting}, {difference}", columns)
            for name, test in (TESTS | REGISTERED if len(signals) == 1 else TESTS).items():
                found = [peer_study(seed, difference, signals, test) for seed in range(n_studies)]
                print_row(name, cells_of(found))


def cells_of(found):
    """Of the studies of one test."""
    cells = []
    for key in ("joint", "shape", "timing", "right"):
        values = [row[key] for row in found if row.get(key) is not None]
        cells.append(percent(np.mean(values)) if values else "-")
    for key in ("shape overlap", "timing overlap"):
        values = [row[key] for row in found if key in row]
        cells.append(f"{np.median(values):.2f}" if values else "-")
    return cells


# -- the data sets of nlreg1d --------------------------------------------------------------


def stretches(mask):
    """Of frames, in per cent, as text."""
    edges = np.flatnonzero(np.diff(np.r_[0, mask.astype(int), 0])).reshape(-1, 2)
    scale = 100 / (len(mask) - 1)
    return ", ".join(f"{scale * a:.0f}-{scale * (b - 1):.0f}" for a, b in edges) or "not"


def nlreg1d_table(folder):
    """Answers to each set."""
    print_head("set", ["nlreg1d, with fdasrsf of today", "compare_groups"])
    for path in sorted((folder / "nlreg1d").glob("*.csv")):
        table = np.loadtxt(path, delimiter=",")
        table = table[np.argsort(table[:, 0], kind="stable")]
        groups, curves = table[:, 0].astype(int).tolist(), table[:, 1:]
        n, X = groups.count(0), list(curves[:, :, np.newaxis])
        paired = path.stem.startswith("Pataky")
        rejects, shape, timing = nlreg1d_test(*srsf(curves), n, paired=paired)
        words = f"shape {stretches(shape)}; timing {stretches(timing)}" if rejects else "nothing"
        people = {"groups": [*range(n)] * 2, "paired": True} if paired else {}
        found = compare_groups(DenseSynchronizer(P).fit(X), X, groups, **people)
        print_row(path.stem, [words, found.describe()])


TABLES = {
    "level": level_table,
    "unequal": unequal_table,
    "designs": designs_table,
    "power": power_table,
    "covariate": covariate_table,
    "peers": peer_table,
    "nlreg1d": nlreg1d_table,
}


def with_studies(options):
    """Have all tables but the last make so many studies."""
    for name in [*TABLES][:6] if options.studies else ():
        TABLES[name] = partial(TABLES[name], n_studies=options.studies)


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    command = command_line(__doc__)
    command.add_argument("--studies", type=int, help="how many of a row")
    run_tables(TABLES, command, with_studies)
