"""Faults: what is expected, gains against dense matrices, and faults that were put in."""

import numpy as np
import pytest
from scipy.stats import t as student
from sklearn_motionsync.model.faults import (
    FaultFinder,
    Part,
    expected_trial,
    windows_of,
)
from sklearn_motionsync.model.variation import predictive_variance, within_variance

K = 30
PARTS = [Part("one", [0, 1], [0, 1], None), Part("two", [2], [2], None)]


def people(n_people, n_own, seed=0):
    """Smooth trials with three columns about a common mean, and whose they are."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0, 1, K)[:, np.newaxis]
    mean = np.column_stack([np.sin(6 * t), np.cos(6 * t), 2 * np.sin(3 * t)])
    waves = np.stack([np.ones_like(t), np.sin(9 * t), np.cos(7 * t)])[..., 0]
    groups = np.repeat(np.arange(n_people), n_own)
    persons, moods = (
        np.einsum("nkf,kp->npf", rng.standard_normal((n, 3, 3)), waves)
        for n in (n_people, len(groups))
    )
    return mean + 0.1 * persons[groups] + 0.03 * moods, groups


def expected_by_hand(trials, groups, reference=None):
    """Of a normal prior for the mean of a person, and of the reference, by their precisions."""
    mean, variance = trials.mean(axis=0), predictive_variance(trials, groups)
    if reference is None:
        return mean, variance
    n, within = len(reference), within_variance(trials, groups)
    if n > 1:
        freedom = n - 1
        ratio = reference.var(axis=0, ddof=1).mean(axis=0) / within.mean(axis=0)
        within = within * np.maximum(1, (2 + freedom * ratio) / (2 + freedom))
    prior = 1 / np.maximum(variance - within, within / 20)
    total = prior + n / within
    return (prior * mean + reference.sum(axis=0) / within) / total, within + 1 / total


def test_the_expected_mean_lies_between_others_and_the_reference():
    X, groups = people(6, 4)
    for n, apart in ((1, 0), (2, 0.3), (4, 0)):
        reference = X[:n] + 0.2 + apart * np.arange(n)[:, np.newaxis, np.newaxis]
        found, expected = (f(X, groups, reference) for f in (expected_trial, expected_by_hand))
        np.testing.assert_allclose(found, expected, rtol=1e-9)


def windows_by_hand(n):
    """Windows of n frames, and where they begin and end: shares of the clock."""
    t = np.arange(n) / (n - 1)
    if n <= 20:
        runs = [(a, b) for a in range(n) for b in range(a, n)]
        rows = [[float(a <= k <= b) for k in range(n)] for a, b in runs]
        return np.array(rows), t[np.array(runs)]
    rows, spans = [np.ones(n)], [(0.0, 1.0)]
    for length in (5, 10, 15, 20, 25, 30, 35, 40, 45, 50, 60, 70):
        start = -5.0
        while start <= 105 - length:
            ramps = np.stack([100 * t - start, start + length - 100 * t]) / min(8, length)
            x = np.clip(0.5 + ramps, 0, 1)
            rows.append(np.prod(3 * x**2 - 2 * x**3, axis=0))
            spans.append((max(start, 0) / 100, min(start + length, 100) / 100))
            start += min(5, length / 2)
    return np.array(rows), np.array(spans)


@pytest.mark.parametrize("n_frames", [4, 20, 21, 60])
def test_windows_are_those_by_hand(n_frames):
    for found, expected in zip(windows_of(n_frames), windows_by_hand(n_frames), strict=True):
        np.testing.assert_allclose(found, expected, atol=1e-12)


def inverses_by_hand(scores):
    """Of the covariance over time and the correlation between columns of (n, K, n_columns)."""
    n_frames, width = scores.shape[1:]
    rows = [x[:, k] for x in scores for k in range(width)]
    covariance = np.mean([np.outer(row, row) for row in rows], axis=0)
    size = np.diag(covariance).mean()
    if size == 0:
        return np.eye(n_frames), np.eye(width)
    deviations = np.sqrt(np.maximum(np.diag(covariance), 1e-12 * size))
    correlation = covariance / deviations / deviations[:, np.newaxis]
    lags = np.abs(np.subtract.outer(np.arange(n_frames), np.arange(n_frames)))
    by_lag = [np.diag(correlation, k).sum() / n_frames for k in range(n_frames)]
    share = 100 / (100 + len(rows))
    correlation += share * (np.array(by_lag)[lags] - correlation)
    over_time = np.linalg.inv(0.9 * correlation + 0.1 * np.eye(n_frames))
    between = sum(x.T @ over_time @ x for x in scores)
    norms = np.sqrt(np.maximum(np.diag(between), 1e-12 * np.diag(between).max()))
    between = 0.8 * between / norms / norms[:, np.newaxis]
    np.fill_diagonal(between, 1)
    return over_time / size, np.linalg.inv(between)


def gain_of(effects, precision, z):
    """Gains of the best multiples of effects (n_windows, n, size) together, and the multiples."""
    weighed = (effects.reshape(-1, len(z)) @ precision).reshape(effects.shape)
    sums = (weighed @ z)[..., np.newaxis]
    best = np.linalg.solve(weighed @ effects.swapaxes(1, 2), sums)
    return (sums * best).sum(axis=(1, 2)), best[..., 0]


def gain_within(effect, precision, z, least, most):
    """The gain of the best multiple of one effect between bounds, and the multiple."""
    total, norm = effect @ precision @ z, effect @ precision @ effect
    best = np.clip(total / norm, least, most) if norm > 1e-12 else 0.0
    return 2 * best * total - best**2 * norm, best


def evidence_by_hand(trial, expected, inverses, parts):
    """Gains of all faults of each part, by the whole precision matrix; and of standing still."""
    (mean, variance), (over_time, between) = expected, inverses
    n_frames, scale, precision = len(mean), 1 / np.sqrt(variance), np.kron(over_time, between)
    z = (trial - mean) * scale

    def effect(curves, columns):
        out = np.zeros(mean.shape)
        out[:, columns] = (curves * scale)[:, columns]
        return out.ravel()

    windows, spans = windows_by_hand(n_frames)
    frames, reach, of_parts = np.arange(n_frames), n_frames // 5, []
    for part in parts:
        designs = [[effect(w[:, np.newaxis], k) for k in part.columns] for w in windows]
        gains, changes = gain_of(np.array(designs), precision, z.ravel())
        best = int(np.argmax(gains >= (1 - 1e-9) * max(gains)))
        alone = sum(
            gain_of((windows * scale[:, k])[:, np.newaxis], over_time, z[:, k])[0]
            for k in part.columns
        )
        late = {0: 0.0}
        for lag in [*range(-reach, 0), *range(1, reach + 1)]:
            shift = mean[np.clip(frames - lag, 0, n_frames - 1)] - mean
            late[lag] = gain_within(effect(shift, part.columns), precision, z.ravel(), 1, 1)[0]
        lag = max(late, key=late.get)
        swing = effect(mean - mean.mean(axis=0), part.columns)
        ratio_gain, change = gain_within(swing, precision, z.ravel(), -1, 2)
        of_parts.append({
            "gain": gains[best], "change": changes[best], "window": windows[best],
            "span": spans[best], "alone": max(alone),
            "lag gain": late[lag], "lag": lag, "ratio gain": ratio_gain, "ratio": 1 + change,
        })  # fmt: skip
    swing = effect(mean - mean.mean(axis=0), slice(None))
    still, change = gain_within(swing, precision, z.ravel(), -1, np.inf)
    return of_parts, still if change < -0.5 else 0.0


class ByHand:
    """What `FaultFinder` does, in the slow and obvious way."""

    def __init__(self, trials, groups, parts, reference=None, *, floor=0.0, linear=None):
        self.parts, self.n_frames = parts, trials.shape[1]
        self.whole, rows = self.learn(trials, groups, reference, parts, floor)
        self.late, totals_late = None, []
        if linear is not None:
            in_time, of_whom, reference_in_time = linear
            width = in_time.shape[2]
            self.known = [part for part in parts if max(part.columns) < width]
            floor = np.broadcast_to(floor, trials.shape[2])[:width]
            self.late, late = self.learn(in_time, of_whom, reference_in_time, self.known, floor)
            totals_late = [evidence_by_hand(x, *of_one, self.known)[0] for _, x, *of_one in late]
        pairs = len(totals_late) == len(rows)
        of_trials = [evidence_by_hand(x, *of_one, parts) for _, x, *of_one in rows]
        nothing = [{"lag gain": 0.0}] * len(parts)
        totals = [
            max(self.totals(of_parts, totals_late[i] if pairs else nothing))
            for i, (of_parts, _) in enumerate(of_trials)
        ]
        if totals_late and not pairs:
            largest = [max(part["lag gain"] for part in of_parts) for of_parts in totals_late]
            for rank, i in enumerate(np.argsort(totals)):
                totals[i] = max(totals[i], np.percentile(largest, 100 * rank / (len(totals) - 1)))
        alone = [max(part["alone"] for part in of_parts) for of_parts, _ in of_trials]
        self.usual = [np.exp(np.log(np.maximum(x, 1e-12)).mean()) for x in (totals, alone)]
        largest = [
            self.score(total, other, still)
            for total, other, (_, still) in zip(totals, alone, of_trials, strict=True)
        ]
        logs = np.log(largest)
        logs = np.maximum(logs, np.median(logs) - 1)
        whose = np.array([group for group, *_ in rows])
        of_groups = [logs[whose == group] for group in np.unique(whose)]
        means, n = [x.mean() for x in of_groups], len(of_groups)
        squares = np.var(means) * n + (n + 2) * np.mean([x.var() for x in of_groups])
        spread = np.sqrt((squares + 3 * 0.1) / (n + 2) * (1 + 1 / n))
        self.usual_score = 0.75 * np.exp(np.mean(means))
        self.rare_score = np.exp(np.mean(means) + student.ppf(0.95, n + 2) * spread)
        lags = [[part["lag"] for part in of_parts] for of_parts, _ in of_trials]
        ratios = [[max(part["ratio"], 0.01) for part in of_parts] for of_parts, _ in of_trials]
        self.spreads = self.spread(np.array(lags), 1.0), self.spread(np.log(ratios), 0.05)

    def learn(self, trials, groups, reference, parts, floor):
        """The expectation of a new trial, and of each by others: its group, itself, and this."""
        trials, reference = sampled(trials), None if reference is None else sampled(reference)
        counts = [(groups == group).sum() for group in groups]
        many = 0 if reference is None or max(counts) == 1 else len(reference)

        def expected(which, references):
            mean, variance = expected_by_hand(trials[which], groups[which], references)
            raised = variance + floor
            for part in parts:
                raised[:, part.columns] += variance[:, part.columns].mean() / 20
            return mean, raised

        rows = []
        for i, group in enumerate(groups):
            same = [j for j in np.flatnonzero(groups == group) if j != i][:many]
            others = groups != group
            if others.sum() < 2:
                others = groups == groups
            if same or not many:
                rows.append((i, group, expected(others, trials[same] if many else None)))
        scores = np.array([(trials[i] - m) / np.sqrt(v) for i, _, (m, v) in rows])
        whose = np.array([group for _, group, _ in rows])
        by_others = {
            group: inverses_by_hand(scores[whose != group] if len(set(whose)) > 1 else scores)
            for group in whose
        }
        new = expected(slice(None), reference)
        return (new, inverses_by_hand(scores)), [
            (group, trials[i], of_one, by_others[group]) for i, group, of_one in rows
        ]

    def totals(self, of_parts, late):
        """The largest gain of each part; that of lags in linear time, if there is one."""
        names = [part.name for part in self.known] if self.late else []
        out = []
        for part, gains in zip(self.parts, of_parts, strict=True):
            of_lag = gains["lag gain"] if not self.late else 0.0
            if part.name in names:
                of_lag = late[names.index(part.name)]["lag gain"]
            out.append(max(gains["gain"], gains["ratio gain"], of_lag))
        return out

    def score(self, total, alone, still):
        gains = np.maximum([total, alone, still], 1e-12)
        return np.sqrt(max(gains / [*self.usual, self.usual[0]]))

    def spread(self, values, least):
        n, squares = len(values), values**2.0
        return np.maximum(np.sqrt((squares.sum(axis=0) + 5 * squares.mean()) / (n + 5)), least)

    def find(self, trial, in_time=None):
        (mean, _), trial = self.whole[0], sampled(trial[np.newaxis])[0]
        in_time = None if in_time is None else sampled(in_time[np.newaxis])[0]
        faults, is_open = [], np.ones(len(self.parts))
        for _ in range(12):
            of_parts, still = evidence_by_hand(trial, *self.whole, self.parts)
            late = self.late and evidence_by_hand(in_time, *self.late, self.known)[0]
            totals = np.array(self.totals(of_parts, late)) * is_open
            k = int(np.argmax(totals))
            if totals[k] <= 0 or len(faults) == 5:
                break
            part, gains = self.parts[k], of_parts[k]
            share, lag = gains["lag gain"] / gains["gain"], gains["lag"]
            if late and part in self.known:
                of_late = late[self.known.index(part)]
                in_linear = of_late["lag gain"] / of_late["gain"]
                if in_linear >= 0.4 or in_linear >= share:
                    share, lag = in_linear, of_late["lag"]
            of_ratio = gains["ratio gain"] / gains["gain"]
            score = self.score(totals[k], gains["alone"], still)
            if share < 0.4 and of_ratio < 0.5:
                fault = k, "off", *gains["span"], gains["change"], np.nan, score
                trial = trial.copy()
                trial[:, part.columns] -= np.outer(gains["window"], gains["change"])
            else:
                kind, deviation = "late" if lag > 0 else "early", lag / self.spreads[0][k]
                size = lag * (self.n_frames - 1) / (len(trial) - 1)
                if of_ratio / 0.5 > share / 0.4:
                    size = gains["ratio"]
                    kind = "too large" if size > 1 else "too small"
                    deviation = np.log(max(size, 0.01)) / self.spreads[1][k]
                fault, is_open[k] = (k, kind, 0.0, 1.0, size, deviation, score), 0
                trial, in_time = trial.copy(), None if in_time is None else in_time.copy()
                trial[:, part.columns] = mean[:, part.columns]
                if late and part in self.known:
                    in_time[:, part.columns] = self.late[0][0][:, part.columns]
            if all(k != f[0] or fault[2] >= f[3] or f[2] >= fault[3] for f in faults):
                faults.append(fault)
        return faults


def sampled(trials):
    """Trials at 60 frames at most."""
    at = np.linspace(0, trials.shape[1] - 1, min(60, trials.shape[1]))
    return np.apply_along_axis(lambda x: np.interp(at, np.arange(len(x)), x), 1, trials)


def spoiled(x, seed):
    """A trial with a window that is off, and parts that are late, of other amplitude or still."""
    x, rng = x.copy(), np.random.default_rng(seed)
    first, last = np.sort(rng.choice(len(x), 2, replace=False))
    at = np.arange(len(x)) - rng.integers(-8, 8)
    columns = rng.permutation(x.shape[1])
    if seed > 3:
        # The whole body moves less.
        return x.mean(axis=0) + {4: 0.3, 5: 0.65}[seed] * (x - x.mean(axis=0))
    x[first : last + 1, columns[0]] += rng.choice([0.3, -2.0])
    x[:, columns[1]] = x[np.clip(at, 0, len(x) - 1), columns[1]]
    means = x.mean(axis=0)
    if seed % 2:
        x[:, columns[2:]] += (rng.choice([-0.5, 0.1, 1.4, 3.5]) - 1) * (x - means)[:, columns[2:]]
    return x


def resampled(X, n_frames):
    """Trials with so many frames; `people` have `K`."""
    at = np.linspace(0, X.shape[1] - 1, n_frames)
    return np.apply_along_axis(lambda x: np.interp(at, np.arange(len(x)), x), 1, X)


@pytest.mark.parametrize(
    ("n_frames", "groups", "n_reference", "in_linear_time", "variation"),
    [
        (12, [1, 1, 0, 0, 2, 2], 3, "pairs", 1),
        (20, [0, 0, 0, 0], None, None, 0.02),
        (7, [0, 0, 1], None, None, 0),
        (9, [0, 0, 0, 1], 1, None, 1),
        (10, [0, 1, 2, 3], 2, "others", 1),
        (4, [0, 1, 2, 2], None, "others", 1),
        (22, [0, 0, 1, 1, 2], None, None, 1),
        (67, [0, 0, 1, 1], 2, "pairs", 1),
    ],
)
def test_faults_equal_those_by_hand(n_frames, groups, n_reference, in_linear_time, variation):
    """Parts of one and of two columns, one that moves little, and one that never moves."""
    X = resampled(people(len(groups), 1, seed=1)[0], n_frames)
    X = np.concatenate([X, 1e-3 * X[..., :1], np.full((*X.shape[:2], 1), 3.0)], axis=2)
    # Sums of such means are exact: without variation trials are equal.
    mean = np.round(64 * X.mean(axis=0)) / 64
    X = mean + variation * (X - mean)
    groups, reference, linear = np.array(groups), None, None
    parts = [*PARTS, Part("small", [3], [3], None), Part("still", [4], [4], None)]
    if n_frames > 60:
        # All parts of one column.
        del parts[0]
    if n_reference:
        reference = X[:n_reference] + 0.1
    if in_linear_time:
        shifts = np.arange(n_frames) - np.arange(len(X))[::-1, np.newaxis] % 3
        later = [x[np.clip(at, 0, None)] for x, at in zip(X, shifts, strict=True)]
        later, whose = np.stack(later), groups
        if in_linear_time == "others":
            later, whose = later[1:], groups[1:]
        linear = later[..., :4], whose, None if reference is None else reference[..., :4]
    arguments = {"reference": reference, "floor": 1e-3 * np.arange(1, 6), "linear": linear}
    finder, expected = (f(X, groups, parts, **arguments) for f in (FaultFinder, ByHand))
    np.testing.assert_allclose(finder.usual_score, expected.usual_score, rtol=1e-6)
    np.testing.assert_allclose(finder.rare_score, expected.rare_score, rtol=1e-6)
    for seed in range(6 if n_frames < 30 else 2):
        trial = spoiled(X[seed % len(X)], seed)
        in_time = None if linear is None else spoiled(X[seed % len(X)], (seed + 1) % 6)[:, :4]
        # Where trials are equal, rounding is a fault as well.
        most = None if variation else 1
        rows = finder.find(trial, in_time)[:most], expected.find(trial, in_time)[:most]
        assert [f[:2] for f in rows[0]] == [f[:2] for f in rows[1]]
        for a, b in zip(*rows, strict=True):
            for x, y in zip(a[2:], b[2:], strict=True):
                np.testing.assert_allclose(x, y, rtol=1e-5)


@pytest.fixture(scope="module")
def finder():
    return FaultFinder(*people(8, 4), PARTS)


def late(x):
    x = x.copy()
    x[:, 2] = x[np.clip(np.arange(K) - 4, 0, None), 2]
    return x


def large(x):
    x = x.copy()
    x[:, 2] += 0.8 * (x[:, 2] - x[:, 2].mean())
    return x


def off(x):
    x = x.copy()
    x[10:20, :2] += 0.6, -0.4
    return x


@pytest.mark.parametrize(
    ("spoil", "part", "kind"), [(late, 1, "late"), (large, 1, "too large"), (off, 0, "off")]
)
def test_faults_that_were_put_in_come_first(finder, spoil, part, kind):
    faults = [finder.find(spoil(x))[0] for x in people(9, 1, seed=9)[0]]
    for fault in faults:
        assert (fault.part, fault.kind) == (part, kind)
        assert fault.score > finder.rare_score
        if kind == "late":
            assert 2 <= fault.size <= 6
        elif kind == "too large":
            assert 1.5 < fault.size < 2.2
    if kind == "off":
        sizes, starts, stops = (
            np.median([np.ravel(getattr(fault, name)) for fault in faults], axis=0)
            for name in ("size", "start", "stop")
        )
        np.testing.assert_allclose(sizes, [0.6, -0.4], atol=0.15)
        np.testing.assert_allclose([*starts, *stops], [10 / K, 20 / K], atol=0.1)


def test_few_new_people_are_rare(finder):
    scores = [max(f.score for f in finder.find(x)) for x in people(100, 1, seed=5)[0]]
    assert np.mean(np.array(scores) > finder.rare_score) < 0.1
    assert 0.2 < np.mean(np.array(scores) > finder.usual_score) < 0.9
