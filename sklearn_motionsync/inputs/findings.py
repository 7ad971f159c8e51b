"""What numbers mean: angles that wrap, fill values, tails of zeros, other units, and the like."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
import pandas as pd

from .collections import NOT_ONE, as_collection, check_members
from .columns import CONFIDENCE
from .features import choose_features
from .numbers import as_numbers, listed
from .types import TrialsLike
from .wording import counted, within

# The limits below were chosen on faults put into recordings of people and into made ones, so that
# these are told and the recordings themselves have no finding (docs/howto/exports.md).
# Limits of angles that are written within one turn, and the period.
_TURNS = [(-180.0, 180.0, "degrees"), (0.0, 360.0, "degrees")]
_TURNS += [(-np.pi, np.pi, "radians"), (0.0, 2 * np.pi, "radians")]
# A jump from one limit of a turn to the other is of so much of it, and ends this near to them.
_JUMP, _NEAR = 0.75, 0.08
# Jumps are at most such a share of all steps.
_RARE = 0.1
# Numbers that programs write where nothing was seen.
_FILLS = 0.0, -1.0, 999.0, 9999.0, 99999.0, -999.0, -9999.0, 9999999.0
# A fill value is left, or reached, by a step of so much of the range of the other values, which
# is so many times a usual step; at least so many frames have it, and at most half of them.
_FILL_STEP, _FILL_STEPS, _FEWEST = 0.25, 5, 3
# A trial is held where all of its features repeat themselves exactly for so many frames, and so
# small a share of its other frames does.
_HELD, _REPEATS = 6, 0.02
# Factors by which programs differ: degrees and radians, metres and millimetres, inches.
_FACTORS = {57.29578: "degrees and radians", 1000.0: "metres and millimetres"}
_FACTORS |= {100.0: "metres and centimetres", 25.4: "inches and millimetres"}
# How far from a factor a trial may be, as people differ, and its features from each other.
_OF_PEOPLE, _OF_FEATURES = 1.5, 2.5
# Numbers of frames of which one trial has so many times as many as the others are another rate.
_RATES = 2.0, 2.4, 2.5, 4.0, 5.0, 8.0, 10.0
# Names of columns that tell how sure positions are, without those of a letter.
_QUALITY = tuple(word for word in CONFIDENCE if word.isalpha() and len(word) > 3)
# Frames from which on a feature on a straight line counts as a clock.
_CLOCK_FRAMES = 8
# The share of the spread of joints that is along the vertical axis of a body that stands.
_TALL = 0.48
# Exchanges of the axes of joints.
_EXCHANGES = "xzy", "yxz", "zyx", "yzx", "zxy"
# Numbers that a fit looks at together.
_PORTION = 2**17
# Frames of a trial that tell its size and its axes.
_SAMPLED = 16
_MEND = {
    "wrapping": "np.unwrap(x, period={period:.6g}, axis=0), or mend_trials(X, ['wrapping'])",
    "quaternion": "mend_trials(X, ['quaternion']), or angles in place of quaternions",
    "quality": "x.drop(columns=...), and confidence= of fit; read_motion(..., quality='drop')",
    "fill value": "x.replace({value:g}, np.nan), or mend_trials(X, ['fill value'])",
    "clock": "x.drop(columns=...), or to_trials(..., time=...)",
    "constant": "x.drop(columns=...), unless other trials move it",
    "zeros at the end": "x[:{first}], or mend_trials(X, ['zeros at the end'])",
    "missing at the end": "x[:{first}], or mend_trials(X, ['missing at the end'])",
    "held at the end": "x[:{first}], unless the body stands still there",
    "frozen": "x[{first}:{stop}] = np.nan, and fill_gaps",
    "factor": "multiply or divide the trial by {value:g}, and set x.attrs['units']",
    "exchanged axes": "put the columns of each joint into the order {order}",
    "other rate": "to_trials(x, frame_rate=...), with the rate of each trial in attrs",
}
_WHY = {
    "wrapping": "a mean of both limits lies where no trial was",
    "quaternion": "q and -q are one rotation, and their mean is none",
    "quality": "it tells how sure a position is, and is matched like movement",
    "fill value": "it stands where nothing was seen, and is matched like movement",
    "clock": "it is a clock, not a movement",
    "constant": "it tells nothing of the movement",
    "zeros at the end": "they pad the trial, and are matched like movement",
    "missing at the end": "they pad the trial, which ends before them",
    "held at the end": "the last pose pads the trial, which ends before it",
    "frozen": "the recording stood still, and the body probably did not",
    "factor": "the trial is in another unit",
    "exchanged axes": "the trial has other axes",
    "other rate": "frames of the trial are of another duration",
}
# How a fit says the kinds that change what is learnt, of which it warns.
_WARNED = {
    "wrapping": "angles jump by {value:.5g}, a turn of {value:.3g} {unit}",
    "quaternion": "the sign of a quaternion changes",
    "quality": "values from 0 to 1 that are named or placed like a confidence",
    "fill value": "exactly {value:g}, far from the values around it",
    "clock": "increases evenly in every trial",
    "zeros at the end": "all features are zero from frame {first} on",
    "factor": "about {value:g} times as large or as small as the other trials ({between})",
    "exchanged axes": "its axes fit the other trials in the order {order}",
}


class TrialWarning(UserWarning):
    """Numbers of trials probably mean something else than movement; `check_trials` lists them.

    Examples
    --------
    >>> import warnings
    >>> import numpy as np
    >>> from sklearn_motionsync import LinearSynchronizer, TrialWarning
    >>> t = np.linspace(0, 1, 80)[:, np.newaxis]
    >>> yaw = (170 + 30 * np.sin(3 * t) + 180) % 360 - 180
    >>> with warnings.catch_warnings(record=True) as caught:
    ...     warnings.simplefilter("always", TrialWarning)
    ...     sync = LinearSynchronizer().fit([yaw, yaw[5:]])
    >>> "period=360" in str(caught[0].message)
    True
    """


class Finding(NamedTuple):
    """A row of the table of `check_trials`; trials and features by their indices."""

    kind: str
    trial: int
    feature: int | None
    first: int
    last: int
    value: float
    n_trials: int = 1
    facts: dict = {}

    def fill(self, text):
        """A text of the table with what it says of this finding."""
        return text.format(first=self.first, stop=self.last + 1, value=self.value, **self.facts)


def check_trials(X: TrialsLike) -> pd.DataFrame:
    """What numbers of trials probably mean, other than movement.

    Angles that jump by a turn, quaternions, columns of confidence, fill values, padding, trials in
    another unit or with other axes: what programs write, and what no synchronizer can tell from
    movement. Every ``fit`` has the same look, and warns by `TrialWarning` of the kinds that change
    its result.

    Parameters
    ----------
    X : list of arrays (n_frames_i, n_features), 3-D array, or DataFrame of trials
        NaN is admitted.

    Returns
    -------
    DataFrame
        A row a finding, columns first and then trials:

        - ``kind``: of a feature in any trials ``"wrapping"``, ``"quaternion"`` (its first
          column), ``"quality"``, ``"fill value"``, ``"clock"`` or ``"constant"``; of a trial
          against the others ``"zeros at the end"``, ``"missing at the end"``,
          ``"held at the end"``, ``"frozen"``, ``"factor"``, ``"exchanged axes"`` or
          ``"other rate"``.
        - ``trial``: the label of the trial, the first one of several, and ``n_trials``, how many.
        - ``feature``: its name or number; None of whole trials.
        - ``first``, ``last``: frames of that trial, counted from 0.
        - ``value``: the period, the fill value, or the factor; NaN of other kinds.
        - ``why`` it matters, and ``mend``, the line that mends it.

    Raises
    ------
    ValueError
        If X is not a set of trials.

    See Also
    --------
    mend_trials : Mends what can be mended without a doubt.
    sklearn_motionsync.io.find_gaps : Lists what is missing.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_motionsync import check_trials
    >>> from sklearn_motionsync.datasets import make_gait
    >>> trials = [np.asarray(x) for x in make_gait(timing=6, random_state=0).data]
    >>> trials[3] = np.deg2rad(trials[3])
    >>> check_trials(trials)[["kind", "trial", "value"]].round(1)
         kind  trial  value
    0  factor      3   57.3
    """
    trials, names = _read(X)
    rows = []
    for each in _look(trials, names):
        label = trials.labels[each.trial] if trials.labels else each.trial
        feature = each.feature if each.feature is None or names is None else names[each.feature]
        why, mend = _WHY[each.kind], each.fill(_MEND[each.kind])
        rows.append(
            (each.kind, label, each.n_trials, feature, each.first, each.last, each.value, why, mend)
        )
    columns = ["kind", "trial", "n_trials", "feature", "first", "last", "value", "why", "mend"]
    return pd.DataFrame(rows, columns=columns)


def mend_trials(
    X: TrialsLike,
    kinds: Sequence[str] = ("wrapping", "zeros at the end"),
    period: float | Mapping[str | int, float] | None = None,
) -> list:
    """Trials without those findings that can be mended without a doubt.

    Parameters
    ----------
    X : trials
        As for `check_trials`.
    kinds : sequence of str, default=("wrapping", "zeros at the end")
        ``"wrapping"``: angles go on beyond a turn, and each trial begins within half a turn of
        the first one. ``"quaternion"``: the signs go on within a trial and agree with those of the
        first one. ``"fill value"``: it becomes NaN. ``"zeros at the end"`` and ``"missing at the
        end"``: these frames are left out.
    period : float, or dict of feature to float, default=None
        What a turn is in features that are circular, such as 360 of headings in degrees: of all
        features, or of those that are given by index or name. They are mended as ``"wrapping"``,
        also where no trial wraps by itself and only some are near the other end. Then they are
        matched and averaged on the circle.

    Returns
    -------
    list of ndarray, or of DataFrame
        As X has them; those without a finding are not copied.

    Raises
    ------
    ValueError
        If a kind is none of these, a period is not above 0, or there is no such feature.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_motionsync import check_trials, mend_trials
    >>> t = np.linspace(0, 1, 80)[:, np.newaxis]
    >>> yaw = (170 + 30 * np.sin(3 * t) + 180) % 360 - 180
    >>> mended = mend_trials([yaw, yaw[5:]])
    >>> float(mended[1].max().round()), len(check_trials(mended))
    (200.0, 0)
    """
    kinds = [kinds] if isinstance(kinds, str) else list(kinds)
    for kind in kinds:
        if kind not in _MENDERS:
            raise ValueError(f"kinds are {list(_MENDERS)}, got {kind!r}.")
    trials, names = _read(X)
    findings = [each for each in _look(trials, names) if each.kind in kinds]
    if period is not None:
        periods = _read_period(period, names, trials[0].shape[1])
        findings = [each for each in findings if each.feature not in periods]
        for feature, size in periods.items():
            findings.append(Finding("wrapping", 0, feature, 0, 0, 0.0, facts={"period": size}))
    # A fill value is hidden before anything is compared, and padding is cut off at last.
    findings.sort(key=lambda each: list(_MENDERS).index(each.kind))
    arrays = [np.array(x) if findings else x for x in trials]
    for each in findings:
        _MENDERS[each.kind](arrays, each)
    given = list(as_collection(X))
    return [
        pd.DataFrame(x, index=old.index[: len(x)], columns=old.columns).__finalize__(old)
        if isinstance(old, pd.DataFrame)
        else x
        for x, old in zip(arrays, given, strict=True)
    ]


def _read_period(period, names, n_features):
    """The period of each circular feature, by index."""
    names = [f"x{k}" for k in range(n_features)] if names is None else list(names)
    if not isinstance(period, Mapping):
        period = dict.fromkeys(range(n_features), period)
    sizes = as_numbers(list(period.values()), "The periods", dtype=np.float64)
    if not (sizes > 0).all() or not np.isfinite(sizes).all():
        raise ValueError(f"period must be above 0, such as 360 of degrees; got {period!r}.")
    indices = choose_features(list(period), names)
    return dict(zip(indices, sizes.tolist(), strict=True))


def warn_of_findings(trials, names, *, clocks=True):
    """Warn, in a fit, of findings that change what is learnt; names are None without any.

    Of clocks only where trials are matched: a body that walks goes on evenly, too.
    """
    # Few trials at a time, which take little memory.
    portion_of = np.cumsum([x.size for x in trials]) // _PORTION
    starts = np.flatnonzero(np.diff(portion_of, prepend=-1))
    findings = {}
    for start, stop in zip(starts, [*starts[1:], len(trials)], strict=True):
        for each in _look(trials[start:stop], names, cheap=True):
            if each.kind in _WARNED and (clocks or each.kind != "clock"):
                # A feature is told once, in the first trial that shows it.
                trial = each.trial + int(start) if each.feature is None else None
                findings.setdefault((each.kind, each.feature, trial), (start, each))
    findings = [each._replace(trial=each.trial + int(start)) for start, each in findings.values()]
    for kind in _WARNED:
        alike = [x for x in findings if x.kind == kind]
        if not alike:
            continue
        first = alike[0]
        if first.feature is None:
            what = trials.called(first.trial)
            more = f", and {counted(len(alike) - 1, 'other trial')}" if len(alike) > 1 else ""
        else:
            labels = [x.feature if names is None else names[x.feature] for x in alike]
            what = f"Feature {labels[0]!r}" if len(alike) == 1 else f"Features {listed(labels)}"
            where = within(trials.called(first.trial))
            more = "" if kind in ("quality", "clock") else f" in {where}, frame {first.first}"
        warnings.warn(
            f"{what}{more}: {first.fill(_WARNED[kind])}; {_WHY[kind]}. "
            f"{first.fill(_MEND[kind])}. check_trials(X) lists all.",
            TrialWarning,
            stacklevel=2,
        )


def _read(X):
    """Trials of any kind, and the names of their features or None."""
    sequences = as_collection(X)
    if sequences is None:
        raise ValueError(NOT_ONE)
    trials = check_members(sequences, finite="allow-nan")
    return trials, trials.names


# -- the look ------------------------------------------------------------------------------


class _Numbers:
    """All frames of trials below each other, and what is asked of them more than once."""

    def __init__(self, trials):
        self.trials = trials
        self.lengths = np.array([len(x) for x in trials])
        self.starts = np.concatenate([[0], np.cumsum(self.lengths)[:-1]])
        self.values = np.concatenate(list(trials)) if len(trials) > 1 else np.asarray(trials[0])
        self.low, self.high = self.values.min(axis=0), self.values.max(axis=0)
        self.is_gappy = bool(np.isnan(self.low).any())
        if self.is_gappy:
            self.low, self.high = np.fmin.reduce(self.values), np.fmax.reduce(self.values)

    def steps(self, columns=slice(None)):
        """Sizes of the steps to the next frame; none leads from one trial to the next."""
        steps = np.abs(np.diff(self.values[:, columns], axis=0))
        steps[self.starts[1:] - 1] = 0
        return np.nan_to_num(steps, copy=False) if self.is_gappy else steps

    @cached_property
    def sample(self):
        """Frames of each trial, evenly spread: (n_sequences, 16, n_features), 0 in gaps."""
        shares = np.linspace(0, 1, _SAMPLED)
        rows = self.starts[:, np.newaxis] + np.rint(shares * (self.lengths - 1)[:, np.newaxis])
        values = self.values[rows.astype(np.intp)]
        return np.nan_to_num(values, copy=False) if self.is_gappy else values

    def where(self, row):
        """Trial and frame of a row of ``values``."""
        trial = int(np.searchsorted(self.starts, row, side="right")) - 1
        return trial, int(row - self.starts[trial])


def _look(trials, names, cheap=False):
    """The findings of checked trials, those of features first; a cheap look skips harmless ones."""
    numbers = _Numbers(trials)
    findings = [*_wrapping(numbers), *_quaternions(numbers), *_quality(numbers, names)]
    findings += [*_fill_values(numbers), *_clocks(numbers)]
    if not cheap:
        findings += _throughout("constant", numbers, numbers.low == numbers.high)
    padded = list(_padding(numbers))
    findings += [*padded, *_factors(numbers)]
    ends = [] if names is None else [str(name)[-1:].lower() for name in names[:3]]
    # A fit looks where the first columns are the axes of a joint.
    if not cheap or ends == ["x", "y", "z"]:
        findings += _exchanged(numbers)
    if not cheap:
        findings += [*_held(numbers, {each.trial for each in padded}), *_other_rates(numbers)]
    return findings


def _throughout(kind, numbers, is_one):
    """Findings of the features that are one in all frames of all trials."""
    last, n = len(numbers.trials[0]) - 1, len(numbers.trials)
    return [Finding(kind, 0, int(k), 0, last, np.nan, n) for k in np.flatnonzero(is_one)]


def _of_feature(kind, numbers, k, rows, value, facts=None):
    """A finding of feature k, which shows in some rows."""
    trial, first = numbers.where(rows[0])
    of = np.searchsorted(numbers.starts, rows, side="right") - 1
    last = int(rows[of == trial][-1] - numbers.starts[trial])
    return Finding(kind, trial, int(k), first, last, value, len(np.unique(of)), facts or {})


def _wrapping(numbers):
    """Features that jump from one limit of a turn to the other."""
    for low, high, unit in _TURNS:
        period = high - low
        slack = _NEAR * period
        inside = (numbers.low >= low - 1e-3 * period) & (numbers.high <= high + 1e-3 * period)
        for k in np.flatnonzero(inside & (numbers.high - numbers.low > _JUMP * period)):
            x, steps = numbers.values[:, k], numbers.steps(k)
            rows = np.flatnonzero(steps > _JUMP * period)
            if not 0 < len(rows) <= _RARE * len(x):
                continue
            pairs = np.stack([x[rows], x[rows + 1]])
            ends = (pairs.min(axis=0) < low + slack) & (pairs.max(axis=0) > high - slack)
            usual = np.quantile(steps[steps <= _JUMP * period], 0.99)
            left = period - steps[rows]
            if ends.all() and (left <= np.maximum(3 * usual, 0.01 * period)).all():
                facts = {"period": period, "unit": unit}
                yield _of_feature("wrapping", numbers, k, rows, float(period), facts)


def _quaternions(numbers):
    """First columns of unit quaternions of which a sign changes."""
    width = len(numbers.low)
    fits = (numbers.low > -1.01) & (numbers.high < 1.01)
    if width < 4 or not fits.any():
        return
    # The first frames tell where none is, and a few of each trial the others.
    unit = _is_unit(numbers.values[numbers.starts], 4, 0.01)
    if unit.any():
        sample = numbers.sample.reshape(-1, width)
        # Three columns of length 1 are a direction.
        direction = _is_unit(sample, 3, 1e-3)
        unit = _is_unit(sample, 4, 0.01) & ~(direction[:-1] | direction[1:])
    after = 0
    for k in np.flatnonzero(unit):
        q = numbers.values[:, k : k + 4]
        if k < after or not fits[k : k + 4].all():
            continue
        if np.nanmax(np.abs(np.square(q).sum(axis=1) - 1)) < 0.02:
            after = k + 4
            signs = np.vecdot(q[:-1], q[1:])
            signs[numbers.starts[1:] - 1] = 1
            firsts = q[numbers.starts] @ np.nan_to_num(q[0])
            flips = np.concatenate([np.flatnonzero(signs < 0) + 1, numbers.starts[firsts < 0]])
            if len(flips):
                yield _of_feature("quaternion", numbers, k, np.sort(flips), np.nan)


def _is_unit(rows, n, tolerance):
    """Whether n columns, from each one on, are of length 1 in all rows."""
    squares = np.square(rows)
    lengths = sum(squares[:, i : squares.shape[1] - n + i + 1] for i in range(n))
    return (np.abs(lengths - 1) < tolerance).all(axis=0)


def _quality(numbers, names):
    """Columns of confidence, by their names, or every third one beside pictures' coordinates."""
    width = len(numbers.low)
    inside = (numbers.low >= 0) & (numbers.high <= 1)
    if names is not None:
        words = [str(name[-1] if isinstance(name, tuple) else name).lower() for name in names]
        return _throughout("quality", numbers, inside & [word.endswith(_QUALITY) for word in words])
    is_third = np.arange(width) % 3 == 2
    shaped = (
        width % 3 == 0
        and width > 3
        and inside[is_third].all()
        and (numbers.high[~is_third] > 2).all()
    )
    moves = (numbers.low < numbers.high)[is_third].all()
    return _throughout("quality", numbers, is_third & shaped & moves)


def _fill_values(numbers):
    """Features with stretches of a number that stands for what was not seen."""
    values, moves = numbers.values, numbers.low < numbers.high
    borders = numbers.starts[1:] - 1
    fills = np.array(_FILLS)[:, np.newaxis]
    reaches = (numbers.low <= fills) & (numbers.high >= fills) & moves
    for fill in np.array(_FILLS)[reaches.any(axis=1)]:
        is_fill = values == fill
        if np.count_nonzero(is_fill) < _FEWEST:
            continue
        counts, hidden = is_fill.sum(axis=0), np.zeros(len(moves), dtype=bool)
        for k in np.flatnonzero(moves & (counts >= _FEWEST) & (counts <= len(values) / 2)):
            filled, of_k = is_fill[:, k], numbers.steps(k)
            others = values[~filled, k]
            others = others[~np.isnan(others)]
            # Steps between the other values, and those to and from the fill value.
            joins = filled[:-1] != filled[1:]
            joins[borders] = False
            between = ~filled[:-1] & ~filled[1:]
            if not len(others) or not between.any() or not joins.any():
                continue
            smallest, span = of_k[joins].min(), np.ptp(others)
            if smallest <= _FILL_STEP * span:
                continue
            span = max(span, abs(np.median(others) - fill))
            limit = max(_FILL_STEP * span, _FILL_STEPS * np.quantile(of_k[between], 0.95))
            if smallest > limit and np.mean(of_k[between] > 0) > 0.5:
                # So are the other coordinates of a joint, which may be near to the fill value.
                same = is_fill[filled].all(axis=0) & moves
                # Where whole frames have it, the trial is padded.
                hidden |= same & ~is_fill[filled].all()
        for k in np.flatnonzero(hidden):
            rows = np.flatnonzero(is_fill[:, k])
            yield _of_feature("fill value", numbers, k, rows, float(fill))


def _clocks(numbers):
    """Features, one of several, that only count the time."""
    width = numbers.values.shape[1]
    if width == 1 or numbers.lengths.min() < _CLOCK_FRAMES:
        return []
    clocks = np.ones(width, dtype=bool)
    for x in numbers.trials:
        step = (x[-1] - x[0]) / (len(x) - 1)
        line = x[0] + step * np.arange(len(x))[:, np.newaxis]
        # On a straight line, within half a step: times are rounded.
        clocks &= (np.diff(x, axis=0) > 0).all(axis=0) & (np.abs(x - line) <= step / 2).all(axis=0)
        if not clocks.any():
            break
    return _throughout("clock", numbers, clocks)


def _padding(numbers):
    """Trials that end in zeros or in NaN."""
    last = numbers.values[numbers.starts + numbers.lengths - 1]
    for i in np.flatnonzero(((last == 0) | np.isnan(last)).all(axis=1)):
        x, n = numbers.trials[i], numbers.lengths[i]
        n_missing = _run(np.isnan(x).all(axis=1)[::-1])
        if n_missing:
            yield Finding(
                "missing at the end", int(i), None, int(n - n_missing), int(n - 1), np.nan
            )
            continue
        zero = (x == 0).all(axis=1)
        n_zero = _run(zero[::-1])
        if _FEWEST <= n_zero < n and not zero[0]:
            steps = np.nan_to_num(np.abs(np.diff(x, axis=0)).sum(axis=1))
            usual = steps[: n - n_zero - 1]
            if steps[n - n_zero - 1] > _FILL_STEPS * (np.median(usual) if len(usual) else 0):
                yield Finding("zeros at the end", int(i), None, int(n - n_zero), int(n - 1), np.nan)


def _held(numbers, padded):
    """Runs of frames, of trials without padding, in which all features repeat exactly."""
    still = ~numbers.steps().any(axis=1)
    if numbers.is_gappy:
        still &= ~np.isnan(numbers.values[:-1]).all(axis=1)
    for i, start in enumerate(numbers.starts):
        n = int(numbers.lengths[i])
        quiet = still[start : start + n - 1]
        edges = np.flatnonzero(np.diff(np.concatenate([[0], quiet.astype(int), [0]])))
        long = [(int(a), int(b)) for a, b in edges.reshape(-1, 2) if b - a >= _HELD]
        n_others = quiet.sum() - sum(b - a for a, b in long)
        # One that begins still may also end still.
        if i in padded or not long or long[0][0] == 0 or n_others > _REPEATS * len(quiet):
            continue
        for a, b in long:
            kind = "held at the end" if b == n - 1 else "frozen"
            yield Finding(kind, i, None, a + 1, b, np.nan)


def _run(flags):
    """How many of the first are true."""
    return int(np.argmin(flags)) if not flags.all() else len(flags)


def _factors(numbers):
    """Trials that are so many times as large as the others as units differ."""
    if len(numbers.trials) < 3:
        return
    squares = np.square(numbers.sample).mean(axis=1)
    usual = np.median(squares, axis=0)
    counts = usual > 1e-12 * usual.max(initial=0)
    if not counts.any():
        return
    ratios = 0.5 * np.log(np.maximum(squares[:, counts], 1e-300) / usual[counts])
    sizes = np.median(ratios, axis=1)
    for i in np.flatnonzero(np.abs(sizes) > np.log(25.4 / _OF_PEOPLE)):
        off = [abs(abs(sizes[i]) - np.log(factor)) for factor in _FACTORS]
        factor = list(_FACTORS)[int(np.argmin(off))]
        alike = np.abs(ratios[i] - sizes[i]) < np.log(_OF_FEATURES)
        others = np.delete(sizes, i)
        scatter = np.median(np.abs(others - np.median(others)))
        if min(off) < np.log(_OF_PEOPLE) and alike.mean() > 0.6 and scatter < np.log(2):
            last, facts = int(numbers.lengths[i]) - 1, {"between": _FACTORS[factor]}
            yield Finding("factor", int(i), None, 0, last, round(factor, 1), 1, facts)


def _exchanged(numbers):
    """Trials whose mean pose fits the others if the axes of all joints are exchanged.

    A body is tall: its joints spread most along one axis, the same one in all trials, whichever
    way people face.
    """
    width, n = numbers.values.shape[1], len(numbers.trials)
    if width % 3 or width < 9 or n < 4 or numbers.is_gappy:
        return
    means = numbers.sample.mean(axis=1).reshape(n, -1, 3)
    means -= means.mean(axis=1, keepdims=True)
    usual = np.median(means, axis=0)
    away = np.linalg.norm(means - usual, axis=(1, 2))
    typical = max(np.median(away), 1e-9 * np.linalg.norm(usual))
    spreads = means.std(axis=1)
    is_tall = spreads.max(axis=1) > _TALL * spreads.sum(axis=1)
    tallest = spreads.argmax(axis=1)
    up = int(np.bincount(tallest[is_tall], minlength=3).argmax())
    agree = np.mean(is_tall & (tallest == up)) > 0.7
    for i in range(n):
        turned = bool(agree and is_tall[i] and tallest[i] != up)
        if not turned and away[i] <= 4 * typical:
            continue
        fits = {
            order: np.linalg.norm(means[i][:, ["xyz".index(axis) for axis in order]] - usual)
            for order in _EXCHANGES
            if not turned or order[up] == "xyz"[tallest[i]]
        }
        order = min(fits, key=fits.get)
        if turned or (fits[order] < 0.3 * away[i] and fits[order] < 3 * typical):
            last, facts = int(numbers.lengths[i]) - 1, {"order": order}
            yield Finding("exchanged axes", i, None, 0, last, np.nan, 1, facts)


def _other_rates(numbers):
    """Trials that have as many times the frames of the others as rates differ."""
    if len(numbers.trials) < 4:
        return
    logs = np.log(numbers.lengths / np.median(numbers.lengths))
    if np.median(np.abs(logs)) > 0.08:
        return
    for i, size in enumerate(logs):
        off = [abs(abs(size) - np.log(rate)) for rate in _RATES]
        if min(off) < 0.08 and abs(size) > 8 * max(np.median(np.abs(logs)), 0.02):
            value = _RATES[int(np.argmin(off))] ** (1 if size > 0 else -1)
            yield Finding("other rate", i, None, 0, int(numbers.lengths[i]) - 1, value)


# -- mending -------------------------------------------------------------------------------


def _hide(arrays, finding):
    for x in arrays:
        x[x[:, finding.feature] == finding.value, finding.feature] = np.nan


def _unwrap(arrays, finding):
    k, period = finding.feature, finding.facts["period"]
    first = None
    for x in arrays:
        seen = ~np.isnan(x[:, k])
        if not seen.any():
            continue
        x[seen, k] = np.unwrap(x[seen, k], period=period)
        middle = x[seen, k].mean()
        first = middle if first is None else first
        x[:, k] -= period * np.round((middle - first) / period)


def _agree(arrays, finding):
    of, first = slice(finding.feature, finding.feature + 4), None
    for x in arrays:
        signs = np.sign(np.vecdot(x[:-1, of], x[1:, of]))
        x[1:, of] *= np.cumprod(np.where(signs < 0, -1, 1))[:, np.newaxis]
        mean = np.nanmean(x[:, of], axis=0)
        first = mean if first is None else first
        if mean @ first < 0:
            x[:, of] *= -1


def _cut(arrays, finding):
    arrays[finding.trial] = arrays[finding.trial][: finding.first]


_MENDERS = {"fill value": _hide, "wrapping": _unwrap, "quaternion": _agree}
_MENDERS |= {"zeros at the end": _cut, "missing at the end": _cut}
