"""What is wrong with a trial: the part of it, the kind of fault, when, and how large.

A fault changes one part, such as a limb: by a constant over a window of time, by a lag, or in its
amplitude. The evidence is twice the gain in the log likelihood of the deviations from what is
expected, which are normal, with a covariance over time and one between features. Both are those of
training trials from the expectation by other people.
"""

from typing import NamedTuple

import numpy as np

from ..matching.counting import first_largest
from ..matching.warps import at_times
from .acceptance import t_prediction_limit
from .variation import predictive_variance, within_variance

# All was chosen on HDM05 and two exercises of UI-PRMD (benchmarks/departures.py).
# Frames of the clock on which faults are sought, at most.
_MOST_FRAMES = 60
# Lengths of windows, and the ramp at their ends, as shares of the clock.
_LENGTHS = 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.5, 0.6, 0.7
_RAMP, _STEP = 0.08, 0.05
# With so few frames every run of frames is a window.
_FEW_FRAMES = 20
# The largest lag, as a share of the clock.
_LARGEST_LAG = 0.2
# The largest ratio of amplitudes: a mean that hardly moves has none.
_LARGEST_RATIO = 3.0
# Share of white noise in the covariance over time, and of independence between features.
_WHITE, _INDEPENDENT = 0.1, 0.2
# Rows that the covariance over time is worth in which it depends on the lag only.
_STATIONARY_ROWS = 100
# A floor of the variance, as a share of its mean over time and the features of a part.
_VARIANCE_FLOOR, _SMALLEST = 0.05, 1e-12
# Variance between people, as a share of that within, at least.
_LEAST_BETWEEN = 0.05
# Degrees of freedom that the variance within others weighs against that of the reference.
_PRIOR_COUNT = 2
# A fault is a lag, or of amplitude, if this explains so much of what a window explains.
_LAG_EXPLAINS, _RATIO_EXPLAINS = 0.4, 0.5
# Evidence is listed from this share of the median of right trials on: then 72 % of
# faults in three classes of HDM05 have their region in the first row, with 1 it is 59 %; of right
# trials 72 % have a row, with 1 it is 39 %.
_HINT = 0.75
# Prior variance of the logarithm of the largest score, as in `simultaneous_factor`.
_PRIOR_VARIANCE, _BELOW_MEDIAN = 0.1, 1.0
# Lags and log ratios of people vary by so much at least: frames, and in the logarithm.
_LEAST_LAG, _LEAST_RATIO = 1.0, 0.05
# Most faults of a trial, and most that are taken away to find them.
_MOST_FAULTS, _MOST_STEPS = 5, 12


class Part(NamedTuple):
    """A part of a trial: a limb, or a feature.

    Attributes
    ----------
    name : str
    columns : list of int
        Its columns in the trials in which faults are sought.
    features : list of int
        Its features in the view.
    region : str or None
        The part of the body; None if it is no limb.
    """

    name: str
    columns: list
    features: list
    region: str | None


class FoundFault(NamedTuple):
    """A fault of a trial.

    Attributes
    ----------
    part : int
    kind : str
        ``"off"``, ``"late"``, ``"early"``, ``"too small"`` or ``"too large"``.
    start, stop : float
        Shares of the clock.
    size : ndarray or float
        The change of each column of the part; frames of lag; or the ratio of amplitudes.
    deviation : float
        Of lags and ratios, in standard deviations of people; NaN of others.
    score : float
        Square root of the gain, relative to that of right trials: of the part where the
        others are known, of the part alone, or of a body that hardly moves, the largest.
    """

    part: int
    kind: str
    start: float
    stop: float
    size: object
    deviation: float
    score: float


def expected_trial(trials, groups, reference=None):
    """Mean and variance of a new trial.

    Of a new person they are the mean of the trials and `predictive_variance`, v. With n
    reference trials of the person, the mean is that of the posterior distribution:
    ``m + k (r - m)`` with ``k = b / (b + w / n)``, where r is the mean of the reference, w is the
    variance within people and ``b = v - w`` that between them. The variance is ``w (1 + k / n)``.
    If the reference varies more than that of other people, w is raised, feature by feature.

    Parameters
    ----------
    trials : ndarray, shape (n, P, n_features)
    groups : ndarray of int, shape (n,)
    reference : ndarray, shape (n_reference, P, n_features), default=None

    Returns
    -------
    mean, variance : ndarray, shape (P, n_features)
    """
    mean, variance = trials.mean(axis=0), predictive_variance(trials, groups)
    if reference is None:
        return mean, variance
    within, n = within_variance(trials, groups), len(reference)
    if n > 1:
        # A person whose own trials differ more than those of others do.
        ratio = reference.var(axis=0, ddof=1).mean(axis=0) / within.mean(axis=0)
        within = within * np.maximum((_PRIOR_COUNT + (n - 1) * ratio) / (_PRIOR_COUNT + n - 1), 1)
    between = np.maximum(variance - within, _LEAST_BETWEEN * within)
    weight = between / (between + within / n)
    return mean + weight * (reference.mean(axis=0) - mean), within * (1 + weight / n)


class Expectation:
    """What is expected of a trial, and the gain of every fault of one that differs.

    Parameters
    ----------
    mean, variance : ndarray (K, n_columns)
    over_time : ndarray (K, K)
        Inverse of the covariance over time, in units of the variance.
    between : ndarray (n_columns, n_columns)
        Inverse of the correlation between columns.
    parts : list of Part
    windows : ndarray (n_windows, K)
        Of values from 0 to 1.
    lags : ndarray of int (n_lags,)
        Frames by which the mean may be later.
    """

    def __init__(self, mean, variance, over_time, between, parts, windows, lags):
        self.mean, self.scale = mean, 1 / np.sqrt(variance)
        self.over_time, self.between, self.parts = over_time, between, parts
        self._belongs = np.zeros((len(between), len(parts)))
        for k, part in enumerate(parts):
            self._belongs[part.columns, k] = 1
        pairs = [np.ix_(part.columns, part.columns) for part in parts]
        self._blocks = [(rows, columns, between[rows, columns]) for rows, columns in pairs]
        self._windows, scaled = windows, windows[:, :, np.newaxis] * self.scale
        weighted = over_time @ scaled
        self._alone = 1 / np.einsum("wpf,wpf->wf", scaled, weighted)
        self._inverse = []
        for part, (*_, block) in zip(parts, self._blocks, strict=True):
            products = scaled[..., part.columns].swapaxes(1, 2) @ weighted[..., part.columns]
            self._inverse.append(np.linalg.inv(products * block))
        self.lags = lags
        shifts = [(shifted(mean, lag) - mean) * self.scale for lag in lags]
        self._shifts = np.array(shifts).reshape(len(lags), *mean.shape)
        self._shift_norms = self._norms(self._shifts)
        self._swing = (mean - mean.mean(axis=0)) * self.scale
        self._swing_norms = self._norms(self._swing)
        self._whole_norm = np.sum(self._swing * (over_time @ self._swing @ between))

    def weigh(self, deviations):
        """Deviations (K, n_columns) in standard units, by the inverse covariances."""
        return self.over_time @ (deviations * self.scale) @ self.between

    def of_windows(self, weighed):
        """Gains (n_windows, n_parts), and the changes of each part, (n_windows, n_columns)."""
        sums = self._windows @ (self.scale * weighed)
        changes = np.empty_like(sums)
        for part, inverse in zip(self.parts, self._inverse, strict=True):
            changes[:, part.columns] = (inverse @ sums[:, part.columns, np.newaxis])[..., 0]
        return (sums * changes) @ self._belongs, changes

    def of_windows_alone(self, deviations):
        """The largest gain (n_parts,) of a window where other parts tell nothing."""
        weighed = self.over_time @ (deviations * self.scale)
        sums = self._windows @ (self.scale * weighed)
        return ((sums**2 * self._alone) @ self._belongs).max(axis=0)

    def of_lags(self, weighed):
        """The largest gain of a lag of each part, at least 0, and the lag: (n_parts,)."""
        if not len(self.lags):
            return np.zeros(len(self.parts)), np.zeros(len(self.parts))
        sums = np.einsum("lpf,pf->lf", self._shifts, weighed) @ self._belongs
        gains = 2 * sums - self._shift_norms
        best = first_largest(gains, axis=0)
        largest = gains[best, np.arange(len(self.parts))]
        return np.maximum(largest, 0), np.where(largest > 0, self.lags[best], 0)

    def of_amplitude(self, weighed):
        """The gain of another amplitude of each part, and its ratio: (n_parts,)."""
        sums = (self._swing * weighed).sum(axis=0) @ self._belongs
        change = sums / np.maximum(self._swing_norms, _SMALLEST)
        change = np.clip(np.where(self._swing_norms > _SMALLEST, change, 0), -1, _LARGEST_RATIO - 1)
        return 2 * change * sums - change**2 * self._swing_norms, 1 + change

    def of_standing_still(self, weighed):
        """The gain of a smaller amplitude of all parts together, if it is less than half."""
        whole = np.sum(self._swing * weighed)
        change = max(whole / max(self._whole_norm, _SMALLEST), -1)
        return 2 * change * whole - change**2 * self._whole_norm if change < -0.5 else 0.0

    def _norms(self, x):
        """Squared norms (..., n_parts) of each part of deviations (..., K, n_columns)."""
        products = x.swapaxes(-1, -2) @ self.over_time @ x
        norms = [
            (products[..., rows, columns] * block).sum(axis=(-2, -1))
            for rows, columns, block in self._blocks
        ]
        return np.stack(norms, axis=-1)


class FaultFinder:
    """Finds the faults of trials on the clock of a model.

    Parameters
    ----------
    trials : ndarray (n, P, n_columns)
        Right ones on the clock, without gaps.
    groups : ndarray of int (n,)
    parts : list of Part
    reference : ndarray (n_reference, P, n_columns), default=None
        Right ones of the person.
    coverage : float, default=0.95
        The share of trials of new people without a rare fault.
    floor : ndarray (n_columns,), default=0
        Variance that is added to that of all.
    linear : tuple of ndarray, default=None
        Trials in linear time, their groups, and the reference in it, or None: for lags.
    """

    def __init__(
        self, trials, groups, parts, reference=None, *, coverage=0.95, floor=0.0,
        linear=None,
    ):  # fmt: skip
        self.parts = parts
        n_frames = min(trials.shape[1], _MOST_FRAMES)
        self._n_frames, self._last = n_frames, trials.shape[1] - 1
        self._windows, self._spans = windows_of(n_frames)
        largest = int(_LARGEST_LAG * n_frames)
        self._lags = np.array([lag for lag in range(-largest, largest + 1) if lag])
        coarse_reference = None if reference is None else self._coarse(reference)
        self._clock = _Learnt(
            self._coarse(trials), groups, coarse_reference, parts, floor, self._lags
        )
        self._linear = None
        if linear is not None:
            in_time, groups_in_time, reference_in_time = linear
            if reference_in_time is not None:
                reference_in_time = self._coarse(reference_in_time)
            columns = in_time.shape[2]
            known_parts = [part for part in parts if max(part.columns) < columns]
            self._known = np.array([k for k, part in enumerate(parts) if part in known_parts])
            floor = np.broadcast_to(floor, trials.shape[2:])[:columns]
            self._linear = _Learnt(
                self._coarse(in_time),
                groups_in_time,
                reference_in_time,
                known_parts,
                floor,
                self._lags,
            )
            self._late = self._linear.expectation(self._windows)
        self._expected = self._clock.expectation(self._windows)
        self._calibrate(coverage)

    def find(self, trial, in_linear_time=None):
        """The faults of a trial (P, n_columns), the most important first.

        Parameters
        ----------
        trial : ndarray (P, n_columns)
            On the clock, without gaps.
        in_linear_time : ndarray (P, n_columns), default=None
            The same linearly normalised.

        Returns
        -------
        list of FoundFault
        """
        deviations = self._coarse(trial[np.newaxis])[0] - self._expected.mean
        later = None
        if self._linear is not None:
            later = self._coarse(in_linear_time[np.newaxis])[0] - self._late.mean
        faults, is_open = [], np.ones(len(self.parts), dtype=bool)
        for _ in range(_MOST_STEPS):
            fault, effect = self._largest(deviations, later, is_open)
            if fault is None:
                break
            columns = self.parts[fault.part].columns
            if fault.kind == "off":
                deviations[:, columns] -= effect
            else:
                # The whole course of the part is explained.
                is_open[fault.part] = False
                deviations[:, columns] = 0
                if later is not None and max(columns) < later.shape[1]:
                    later[:, columns] = 0
            if not any(_overlap(fault, earlier) for earlier in faults):
                faults.append(fault)
            if len(faults) == _MOST_FAULTS:
                break
        return faults

    def _largest(self, rest, later, is_open):
        """The fault with the largest gain, and its effect on the part; None without one."""
        expected = self._expected
        evidence = self._evidence(expected, rest)
        of_late = None if later is None else self._evidence(self._late, later)
        total = is_open * self._total(evidence, None if of_late is None else of_late.lag_gains)
        part = first_largest(total)
        if not total[part] > 0:
            return None, None
        window = first_largest(evidence.windows[:, part])
        off = max(evidence.windows[window, part], _SMALLEST)
        # By how much of what a window explains a lag, or another amplitude, explains it.
        share, lag = evidence.lag_gains[part] / off, evidence.lags[part]
        if of_late is not None and part in self._known:
            k = int(np.flatnonzero(self._known == part)[0])
            in_time = of_late.lag_gains[k] / max(of_late.windows[:, k].max(), _SMALLEST)
            # The clock follows a limb that is late, and others are early on it.
            if in_time >= _LAG_EXPLAINS or in_time >= share:
                share, lag = in_time, of_late.lags[k]
        share /= _LAG_EXPLAINS
        ratio = evidence.ratios[part]
        of_ratio = evidence.ratio_gains[part] / off / _RATIO_EXPLAINS
        of_all = np.array([total[part], evidence.alone[part], evidence.still])
        score = np.sqrt((of_all / self._usual).max())
        if max(share, of_ratio) < 1:
            columns = self.parts[part].columns
            change = evidence.changes[window, columns]
            effect = self._windows[window][:, np.newaxis] * change
            return FoundFault(
                part, "off", *self._spans[window], change, np.nan, float(score)
            ), effect
        if share >= of_ratio:
            kind, size = "late" if lag > 0 else "early", lag * self._last / (self._n_frames - 1)
            deviation = lag / self._lag_spread[part]
        else:
            kind, size = "too large" if ratio > 1 else "too small", ratio
            deviation = np.log(max(ratio, 0.01)) / self._ratio_spread[part]
        return FoundFault(part, kind, 0.0, 1.0, float(size), float(deviation), float(score)), None

    def _evidence(self, expectation, deviations):
        weighed = expectation.weigh(deviations)
        gains, changes = expectation.of_windows(weighed)
        lag_gains, lags = expectation.of_lags(weighed)
        alone = expectation.of_windows_alone(deviations)
        ratio_gains, ratios = expectation.of_amplitude(weighed)
        still = expectation.of_standing_still(weighed)
        return _Evidence(gains, changes, lag_gains, lags, ratio_gains, ratios, alone, still)

    def _total(self, evidence, late_gains):
        """The evidence that something is wrong with each part, with lags in linear time if any."""
        total = np.maximum(evidence.windows.max(axis=0), evidence.ratio_gains)
        if late_gains is None:
            return np.maximum(total, evidence.lag_gains)
        total[self._known] = np.maximum(total[self._known], late_gains)
        return total

    def _calibrate(self, coverage):
        """The scores that are usual and rare, and how lags and amplitudes of people vary."""
        late, linear = {}, self._linear
        pairs = linear is not None and len(linear.indices) == len(self._clock.indices)
        if linear is not None:
            for i, expectation, deviations in linear.left_out(self._windows[:0]):
                late[i] = expectation.of_lags(expectation.weigh(deviations))[0]
        scores, alone, still, lags, ratios = [], [], [], [], []
        for i, expectation, deviations in self._clock.left_out(self._windows):
            evidence = self._evidence(expectation, deviations)
            # Without pairs, lags in linear time are compared below.
            late_gains = None if linear is None else late[i] if pairs else 0.0
            scores.append(self._total(evidence, late_gains).max())
            alone.append(evidence.alone.max())
            still.append(evidence.still)
            lags.append(evidence.lags), ratios.append(evidence.ratios)
        if linear is not None and not pairs:
            # Others are kept in linear time: the larger ones of both, rank by rank.
            order, ranks = np.argsort(scores), np.linspace(0, 1, len(scores))
            of_late = np.quantile([gains.max() for gains in late.values()], ranks)
            scores = np.maximum(scores, of_late[np.argsort(order)])
        gains = np.maximum([scores, alone, still], _SMALLEST)
        self._usual = np.exp(np.log(gains).mean(axis=1))
        self._usual[2] = self._usual[0]
        codes = np.array([group for *_, group in self._clock.indices])
        logs = 0.5 * np.log((gains / self._usual[:, np.newaxis]).max(axis=0))
        logs = np.maximum(logs, np.median(logs) - _BELOW_MEDIAN)
        # A new trial is one of a new group.
        of_groups = [logs[codes == group] for group in np.unique(codes)]
        means = np.array([x.mean() for x in of_groups])
        within = np.mean([x.var() for x in of_groups])
        squares = np.square(means - means.mean()).sum() + (len(means) + 2) * within
        limit = t_prediction_limit(len(means), squares, coverage, _PRIOR_VARIANCE)
        self.usual_score = float(_HINT * np.exp(means.mean()))
        self.rare_score = float(np.exp(means.mean() + limit))
        self._lag_spread = _spread(np.array(lags), _LEAST_LAG)
        self._ratio_spread = _spread(np.log(np.maximum(ratios, 0.01)), _LEAST_RATIO)

    def _coarse(self, trials):
        """Trials at the frames on which faults are sought."""
        n_frames = trials.shape[1]
        times = np.linspace(0, n_frames - 1, self._n_frames)
        return np.array([at_times(x, times) for x in trials])


class _Evidence(NamedTuple):
    """Gains of faults: of windows, lags and amplitudes, with the changes, lags and ratios.

    ``alone`` are those of windows where other parts tell nothing, and ``still`` is that of a body
    that hardly moves: where all is wrong, no part is by itself.
    """

    windows: np.ndarray
    changes: np.ndarray
    lag_gains: np.ndarray
    lags: np.ndarray
    ratio_gains: np.ndarray
    ratios: np.ndarray
    alone: np.ndarray
    still: float


class _Learnt:
    """What is expected of a new trial, and of those of each group by the other groups."""

    def __init__(self, trials, groups, reference, parts, floor, lags):
        self._trials, self._parts, self._lags = trials, parts, lags
        codes = np.unique(groups, return_inverse=True)[1].ravel()
        n_reference = 0 if reference is None else len(reference)
        if n_reference and np.bincount(codes).max() < 2:
            # No group tells how a person varies about the own trials.
            n_reference = 0
        self._expected, self.indices = {}, []
        for i in range(len(trials)):
            same_group = np.flatnonzero(codes == codes[i])
            same_group = same_group[same_group != i][:n_reference]
            if n_reference and not len(same_group):
                continue
            is_other = codes != codes[i]
            if is_other.sum() < 2:
                is_other[:] = True
            key = (codes[i], i) if n_reference else codes[i]
            if key not in self._expected:
                of_group = trials[same_group] if n_reference else None
                mean, variance = expected_trial(trials[is_other], codes[is_other], of_group)
                self._expected[key] = mean, self._raised(variance, floor)
            self.indices.append((i, key, codes[i]))
        deviations = [trials[i] - self._expected[key][0] for i, key, _ in self.indices]
        scales = [1 / np.sqrt(self._expected[key][1]) for _, key, _ in self.indices]
        self._scores = np.array(deviations) * np.array(scales)
        mean, variance = expected_trial(trials, codes, reference)
        self._moments = mean, self._raised(variance, floor)

    def expectation(self, windows):
        """What is expected of a new trial."""
        return self._expectation(self._moments, precisions(self._scores), windows)

    def left_out(self, windows):
        """Each trial that was left out: index, expectation by others, and deviations."""
        inverses, before = {}, None
        for i, key, group in self.indices:
            if group not in inverses:
                is_other = np.array([other != group for _, _, other in self.indices])
                inverses = {
                    group: precisions(self._scores[is_other] if is_other.any() else self._scores)
                }
            if key != before:
                expectation = self._expectation(self._expected[key], inverses[group], windows)
                before = key
            yield i, expectation, self._trials[i] - expectation.mean

    def _expectation(self, moments, inverses, windows):
        (mean, variance), (over_time, between) = moments, inverses
        parts, lags = self._parts, self._lags
        return Expectation(mean, variance, over_time, between, parts, windows, lags)

    def _raised(self, variance, floor):
        """Variances with a floor."""
        raised = variance + floor
        for part in self._parts:
            mean = variance[:, part.columns].mean()
            raised[:, part.columns] += _VARIANCE_FLOOR * mean
        return raised


def precisions(scores):
    """Inverse covariance over time, and inverse correlation between columns, of scores.

    The covariance over time is pooled over the columns, and shrunk towards one that depends on the
    lag only, and to white noise; the correlation, towards independence.

    Parameters
    ----------
    scores : ndarray, shape (n, K, n_columns)

    Returns
    -------
    over_time : ndarray, shape (K, K)
    between : ndarray, shape (n_columns, n_columns)
    """
    n_frames, width = scores.shape[1:]
    courses = np.concatenate(scores, axis=1)
    n_courses = courses.shape[1]
    covariance = courses @ courses.T / n_courses
    size = np.trace(covariance) / n_frames
    if not size > 0:
        return np.eye(n_frames), np.eye(width)
    deviations = np.sqrt(np.maximum(np.diag(covariance), _SMALLEST * size))
    correlation = covariance / np.outer(deviations, deviations)
    by_lag = np.array([np.trace(correlation, k) for k in range(n_frames)]) / n_frames
    frames = np.arange(n_frames)
    stationary = by_lag[np.abs(frames[:, np.newaxis] - frames)]
    share = _STATIONARY_ROWS / (_STATIONARY_ROWS + n_courses)
    correlation = (1 - share) * correlation + share * stationary
    correlation = (1 - _WHITE) * correlation + _WHITE * np.eye(n_frames)
    inverse = np.linalg.inv(correlation)
    products = np.tensordot(scores, inverse @ scores, axes=[[0, 1], [0, 1]])
    norms = np.sqrt(np.maximum(np.diag(products), _SMALLEST * np.diag(products).max()))
    between = (1 - _INDEPENDENT) * products / np.outer(norms, norms)
    np.fill_diagonal(between, 1.0)
    return inverse / size, np.linalg.inv(between)


def windows_of(n_frames):
    """Windows (n_windows, n_frames) of values from 0 to 1, and their spans (n_windows, 2)."""
    t = np.linspace(0, 1, n_frames)
    if n_frames <= _FEW_FRAMES:
        runs = [(a, b) for a in range(n_frames) for b in range(a, n_frames)]
        frames = np.arange(n_frames)
        windows = np.array([(frames >= a) & (frames <= b) for a, b in runs], dtype=np.float64)
        return windows, t[np.array(runs)]
    spans = [(0.0, 1.0)]
    for length in _LENGTHS:
        starts = np.arange(-_STEP, 1 + _STEP - length + 1e-9, min(_STEP, length / 2))
        spans += [(start, start + length) for start in starts]
    spans = np.array(spans)
    ramp = np.minimum(_RAMP, np.diff(spans))
    rising, falling = ((t - spans[:, :1]) / ramp + 0.5, (spans[:, 1:] - t) / ramp + 0.5)
    windows = _smooth_step(rising) * _smooth_step(falling)
    windows[0] = 1
    return windows, np.clip(np.round(spans, 9), 0, 1)


def shifted(curves, lag):
    """Curves (K, n_columns) so many frames later; the first value stays."""
    at = np.clip(np.arange(len(curves)) - lag, 0, len(curves) - 1)
    return curves[at]


def _smooth_step(x):
    x = np.clip(x, 0, 1)
    return x**2 * (3 - 2 * x)


def _overlap(fault, other):
    """Whether two faults of a part are at the same time."""
    return fault.part == other.part and fault.start < other.stop and other.start < fault.stop


def _spread(values, least):
    """Root mean squares (n_parts,) of values (n, n_parts), shrunk to that of all parts."""
    squares, n = np.square(values), len(values)
    return np.sqrt(np.maximum((squares.sum(axis=0) + 5 * squares.mean()) / (n + 5), least**2))
