"""Gaps: what was hidden is filled by what was seen, and weighed by how well that tells it.

A short gap is interpolated over time. In a longer one hidden features are expected, given all that
was seen of the trial: poses are taken to be normal, and correlated over time. So a hidden
arm follows the other limbs, and joins smoothly what was seen before and after the gap. What remains
unknown of a frame is a share of it, and its complement the weight of the frame in the trellis. So a
short gap counts nearly like none, and a frame of which nothing is known counts nothing.

A take that stands alone is filled by what its own frames tell, as far as they tell more than the
frames beside a gap do.
"""

from typing import NamedTuple

import numpy as np
from scipy.interpolate import Akima1DInterpolator, CubicSpline
from scipy.linalg import solveh_banded

from .counting import ROUNDING, runs_of, whole
from .filters import SMOOTHING
from .sizes import BATCH, CONSTANT

# Cost of a frame of which nothing was seen, in mean squared features: about that of two matched
# ones. Without it a path would stay where nothing was seen. docs/design.md.
UNSEEN = 0.3
# Noise of the features by which others are predicted, as a share of their variance: few people have
# shown them together (docs/design.md).
SHRINKAGE = 0.2
# Penalties of the regressions in a take, as shares of the mean variance of seen positions; in how
# many gaps each is tried; and the power of its error there that is its weight (docs/design.md).
RIDGES = 1e-1, 1e-3, 1e-6
TRIES, POWER = 10, -12
# A guess is left out if it is so many times farther from a line than in all gaps that were tried.
FARTHEST_BEND = 2
# Frames beside a gap that a cubic spline goes by; those farther away do not change it.
REACH = 10
WAYS = {"line": None, "akima": Akima1DInterpolator, "cubic": CubicSpline}


def is_gappy(values):
    """Whether anything in an array is NaN."""
    # A sum is NaN if a term is; no mask is made of what is whole.
    return bool(np.isnan(values.sum()))


def interpolate_gaps(values, longest=np.inf, times=None, held=False, way="akima"):
    """Values whose gaps are interpolated over time.

    Parameters
    ----------
    values : ndarray, shape (n_frames, n_columns)
        NaN where something is hidden. Each column is interpolated by itself.
    longest : float, default=inf
        The longest gap that is filled, in frames.
    times : ndarray, shape (n_frames,), default=None
        Of the frames, in frames, if they are not evenly spaced.
    held : bool, default=False
        Whether a column holds its first and last value in gaps that touch an end; otherwise these
        stay NaN.
    way : {"akima", "cubic", "line"}, default="akima"
        By Akima's piecewise cubic polynomials, by a cubic spline, or by straight lines, which also
        join fewer than three values.

    Returns
    -------
    ndarray of float64, shape (n_frames, n_columns)
        A column of which nothing was seen stays NaN.
    """
    out = values.astype(np.float64)
    hidden = np.isnan(out)
    times = np.arange(len(out)) if times is None else times
    # Columns that are hidden in the same frames, such as those of a joint.
    alike = {}
    for k in np.flatnonzero(hidden.any(axis=0) & ~hidden.all(axis=0)):
        alike.setdefault(hidden[:, k].tobytes(), []).append(k)
    for columns in alike.values():
        mask = hidden[:, columns[0]]
        rows, at = np.flatnonzero(mask), np.flatnonzero(~mask)
        after = np.searchsorted(at, rows)
        if held and times[at[0]] - times[0] <= longest:
            out[np.ix_(rows[after == 0], columns)] = out[at[0], columns]
        if held and times[-1] - times[at[-1]] <= longest:
            out[np.ix_(rows[after == len(at)], columns)] = out[at[-1], columns]
        inside = (after > 0) & (after < len(at))
        rows, after = rows[inside], after[inside]
        rows = rows[times[at[after]] - times[at[after - 1]] <= longest + 1]
        if len(rows):
            known, wanted = out[np.ix_(at, columns)], np.ix_(rows, columns)
            if way == "line" or len(at) < 3:
                lines = [np.interp(times[rows], times[at], values) for values in known.T]
                out[wanted] = np.column_stack(lines)
            else:
                out[wanted] = WAYS[way](times[at], known)(times[rows])
    return out


def fill_with_mean(trials, mean):
    """Trials on one clock whose gaps follow a mean trial.

    Deviations from the mean go on in straight lines, and are held at the ends. They are 0 in
    features that a trial never shows.

    Parameters
    ----------
    trials : ndarray, shape (n, P, n_features)
        With NaN in gaps.
    mean : ndarray, shape (P, n_features)

    Returns
    -------
    ndarray, shape (n, P, n_features)
        The same array if there is no gap.
    """
    if not is_gappy(trials):
        return trials
    hidden, filled = np.isnan(trials), trials.copy()
    for i in np.flatnonzero(hidden.any(axis=(1, 2))):
        deviations = np.nan_to_num(interpolate_gaps(trials[i] - mean, held=True, way="line"))
        np.copyto(filled[i], mean + deviations, where=hidden[i], casting="same_kind")
    return filled


def moments_of_seen(arrays):
    """Mean and covariance of poses with gaps, each of the poses that show it.

    Parameters
    ----------
    arrays : sequence of ndarray (n_frames_i, n_features)
        With NaN where something was not seen. Every feature was seen somewhere.

    Returns
    -------
    mean : ndarray of float64, shape (n_features,)
    covariance : ndarray of float64, shape (n_features, n_features)
        Divided by the number of poses. Negative eigenvalues count by their size.
    """
    seen = [np.isfinite(x).astype(np.float64) for x in arrays]
    counts = sum(s.sum(axis=0) for s in seen)
    mean = sum(np.nansum(x, axis=0, dtype=np.float64) for x in arrays) / np.maximum(counts, 1)
    squares, pairs = np.zeros((2, len(mean), len(mean)))
    for x, s in zip(arrays, seen, strict=True):
        centred = np.where(s > 0, x - mean, 0)
        squares += centred.T @ centred
        pairs += s.T @ s
    values, vectors = np.linalg.eigh(squares / np.maximum(pairs, 1))
    # Without negative ones, and none is lost that features have.
    return mean, (vectors * np.abs(values)) @ vectors.T


class Filler(NamedTuple):
    """Fills the gaps of trials.

    Poses are normal. Over time all features are correlated alike: they forget their value with
    one time constant, and their velocity with another, as an autoregression of second order does.

    Attributes
    ----------
    mean, scale : ndarray, shape (n_features,)
        Poses less the mean, divided by the scale, are in standard units.
    precision : ndarray, shape (n_features, n_features)
        The inverse of their covariance in these units, with the variance of a noise.
    variance : ndarray, shape (n_features,)
        Of the poses, in which velocities take part alike.
    times : tuple of float
        In which values and velocities are forgotten, in frames; 0 if frames have no order.
    """

    mean: np.ndarray
    scale: np.ndarray
    precision: np.ndarray
    variance: np.ndarray
    times: tuple

    @classmethod
    def learn(cls, arrays):
        """The filler of a training set (n_frames_i, n_features), which may have gaps.

        Every feature is seen somewhere.
        """
        return cls.of(*moments_of_seen(arrays), arrays)

    @classmethod
    def of(cls, mean, covariance, arrays):
        """The filler of poses with these moments.

        Parameters
        ----------
        mean : ndarray, shape (n_features,)
        covariance : ndarray, shape (n_features, n_features)
        arrays : sequence of ndarray (n_frames_i, n_features)
            Trials, with NaN where nothing was seen; empty if frames have no order.
        """
        mean, covariance = (np.asarray(a, dtype=np.float64) for a in (mean, covariance))
        variance = np.diag(covariance)
        varies = variance > CONSTANT * variance.max()
        scale = np.sqrt(np.where(varies, variance, 1))
        # Constant features have no unit, and predict nothing.
        noise = np.where(varies, SHRINKAGE, 1)
        precision = np.linalg.inv(covariance / np.outer(scale, scale) + np.diag(noise))
        # A few of many trials, evenly spread, tell how fast poses change.
        arrays = arrays[:: -(-len(arrays) // BATCH) or 1]
        standard = [(x - mean) / scale for x in arrays]
        velocities = [np.diff(z, axis=0) for z in standard]
        times = _correlation_time(standard), _correlation_time(velocities)
        return cls(mean, scale, precision, variance, times)

    def __call__(self, array, confidence=1.0):
        """A trial without gaps, and the weight of each of its frames.

        Parameters
        ----------
        array : ndarray, shape (n_frames, n_features)
            NaN where a feature is hidden.
        confidence : ndarray, shape (n_frames, n_features), default=1.0
            Weights of what is seen.

        Returns
        -------
        filled : ndarray, shape (n_frames, n_features)
        weights : ndarray, shape (n_frames,)
            From 0 to 1.
        """
        hidden = np.isnan(array)
        unknown = np.where(hidden, 0, 1 - confidence)
        bands = _time_precision(len(array), *self.times)
        for (first, end), columns in _gaps_of(hidden).items():
            unknown[first:end, columns] = _unknown_step(bands, first, end)
        for mask in np.unique(hidden[hidden.any(axis=1)], axis=0):
            rows = (hidden == mask).all(axis=1)
            left = np.linalg.inv(self.precision[np.ix_(mask, mask)]).diagonal() - SHRINKAGE
            unknown[np.ix_(rows, mask)] *= np.clip(left, 0, 1)
        weights = 1 - unknown @ self.variance / (self.variance.sum() or 1)
        return self.expect(array).astype(array.dtype), np.clip(weights, 0, 1)

    def expect(self, array, timed=True):
        """A trial whose hidden values are expected, given all that was seen of it.

        Parameters
        ----------
        array : ndarray, shape (n_frames, n_features)
            NaN where a feature is hidden.
        timed : bool, default=True
            Whether rows are the frames of one trial, in order.

        Returns
        -------
        ndarray of float64, shape (n_frames, n_features)
        """
        times = self.times if timed else (0, 0)
        out = array.astype(np.float64)
        # Other features tell less of gaps of one frame, and of those in which velocities last.
        if timed and self.times[0] > 0:
            out = interpolate_gaps(out, max(1, self.times[1]), held=True)
        z = (out - self.mean) / self.scale
        hidden = np.isnan(z)
        z[hidden] = 0
        bands = _time_precision(len(z), *times)
        pulls = bands[0][:, np.newaxis] * z
        for k in range(1, min(len(bands), len(z))):
            pulls[k:] += bands[k, :-k, np.newaxis] * z[:-k]
            pulls[:-k] += bands[k, :-k, np.newaxis] * z[k:]
        pulls = -pulls @ self.precision
        # Beyond so many frames that show all features nothing of a gap matters.
        near = np.convolve(hidden.any(axis=1), np.ones(len(bands) - 1))[: len(z)] > 0
        for first, end in runs_of(near).tolist():
            rows = slice(first, end)
            z[rows][hidden[rows]] = _solve(
                pulls[rows], hidden[rows], self.precision, bands[:, rows]
            )
        return np.where(hidden, z * self.scale + self.mean, out)


def fill_by_take(points, longest=np.inf, times=None):
    """Positions whose gaps are filled by what the other frames of the same take tell.

    Short gaps are filled first, and then count as seen.

    Parameters
    ----------
    points : ndarray, shape (n_frames, n_points, n_dims)
        NaN where a point is hidden.
    longest : float, default=inf
        The longest gap that is filled, in frames.
    times : ndarray, shape (n_frames,), default=None
        Of the frames, in frames, increasing, if they are not evenly spaced.

    Returns
    -------
    ndarray of float64, shape (n_frames, n_points, n_dims)
        Longer gaps, and those that touch an end, stay NaN.
    """
    times = np.arange(len(points)) if times is None else times
    hidden = np.isnan(points).any(axis=2)
    out = np.where(hidden[:, :, np.newaxis], np.nan, points)
    # Where others are hidden at other times, lines are good enough to learn from.
    columns = out.reshape(len(out), hidden.shape[1] * out.shape[2])
    bridged = interpolate_gaps(columns, times=times, held=True, way="line")
    known, bridged = out.copy(), bridged.reshape(out.shape)
    gaps = sorted(_gaps_of(hidden).items(), key=lambda gap: (gap[0][1] - gap[0][0], gap[0]))
    for (first, end), chosen in gaps:
        if first > 0 and end < len(out) and times[end] - times[first - 1] <= longest + 1:
            others = bridged[:, ~np.isnan(out[first:end]).any(axis=(0, 2))]
            wanted = known[:, chosen].reshape(len(out), -1)
            filled = _fill_gap(wanted, others, first, end, times).reshape(
                end - first, len(chosen), -1
            )
            out[first:end, chosen] = bridged[first:end, chosen] = filled
    return out


def _fill_gap(wanted, others, first, end, times):
    """Columns (n_frames, n_columns), NaN where hidden, in a gap from the first frame to the end.

    Other points (n_frames, n_points, n_dims) are seen in it. The columns are regressed on them,
    both as they are and relative to the mean of the others. What a regression leaves is joined
    across the gap in all ways, and so are the columns themselves. These guesses are averaged, with
    weights that fall with their errors in gaps elsewhere in the take.
    """
    seen = ~np.isnan(wanted).any(axis=1)
    middle = others.sum(axis=1) / max(others.shape[1], 1)
    place = np.tile(middle, wanted.shape[1] // middle.shape[1])
    regress = _regressions(wanted, others, seen)
    regress_apart = _regressions(wanted - place, others - middle[:, np.newaxis], seen)

    def guess(starts, length, times=None):
        """All guesses (length, n_starts, n_guesses, n_columns) of gaps of this length."""
        rows = np.arange(-REACH, length + REACH)[:, np.newaxis] + starts
        known = wanted[np.clip(rows, 0, len(wanted) - 1)]
        known[(rows < 0) | (rows >= len(wanted))] = np.nan
        known[REACH : REACH + length] = np.nan
        trends = []
        for near in np.clip(rows, 0, len(wanted) - 1).T:
            gone = near[REACH : REACH + length]
            gone = gone[seen[gone]]
            apart = [place[near] + x for x in regress_apart(near, gone)]
            trends.append([0 * place[near], *regress(near, gone), *apart])
        trends = np.transpose(trends, (2, 0, 1, 3))
        rest = (known[:, :, np.newaxis] - trends).reshape(len(rows), -1)
        joined = [interpolate_gaps(rest, times=times, way=way) for way in WAYS]
        guesses = [x.reshape(trends.shape) + trends for x in joined]
        return np.concatenate(guesses, axis=2)[REACH : REACH + length]

    # As long as the gap, and half as long, with two frames on either side.
    hidden, errors, bends = np.cumsum(np.pad(~seen, (1, 0))), [], []
    for length in sorted({end - first, (end - first + 1) // 2}):
        starts = 2 + np.flatnonzero(hidden[length + 4 :] == hidden[: -length - 4])
        if len(starts):
            starts = starts[whole(np.linspace(0, len(starts) - 1, min(TRIES, len(starts))))]
            truth = wanted[np.arange(length)[:, np.newaxis] + starts]
            guesses = guess(starts, length)
            wrong = guesses - truth[:, :, np.newaxis]
            errors.extend(np.sqrt(np.square(wrong).mean(axis=(0, 3))))
            bends.append(_bends(guesses).max(axis=0))
    if not errors:
        return interpolate_gaps(wanted, times=times)[first:end]
    logs = np.log(np.maximum(errors, ROUNDING * np.max(errors) or 1)).mean(axis=0)
    weights = np.exp(POWER * (logs - logs.min()))
    near = np.clip(np.arange(first - REACH, end + REACH), 0, len(times) - 1)
    guesses = guess(np.array([first]), end - first, times[near])
    # A curve that bends far more than in all other gaps rings, as beside a wrong frame.
    weights *= _bends(guesses)[0] <= FARTHEST_BEND * np.max(bends, axis=0)
    return np.tensordot(guesses[:, 0], weights / weights.sum(), (1, 0))


def _bends(guesses):
    """How far guesses (length, n_gaps, n_guesses, n_columns) are at most from the first, a line."""
    return np.abs(guesses - guesses[:, :, :1]).max(axis=(0, 3))


def _regressions(wanted, others, seen):
    """A function of rows and of frames to leave out: `wanted` there by all ridge regressions.

    Both are centred; what is joined to the frames beside a gap needs no means.
    """
    wanted, others = wanted - wanted[seen].mean(axis=0), others.reshape(len(others), -1)
    centred = others - others.mean(axis=0)
    energy = np.square(centred[seen]).sum() or 1.0
    # Penalties take next to nothing of a constant with the energy of all columns together.
    poses = np.column_stack([centred, np.full(len(others), np.sqrt(energy / seen.sum()))])
    learnt = poses[seen]
    values, axes = np.linalg.eigh(learnt.T @ learnt)
    products, penalty = axes.T @ (learnt.T @ wanted[seen]), energy / len(values)

    def predict(rows, left_out):
        out, near, gone = [], poses[rows] @ axes, poses[left_out] @ axes
        for ridge in RIDGES:
            inverse = 1 / (np.maximum(values, 0)[:, np.newaxis] + ridge * penalty)
            slopes, spread = inverse * products, inverse * gone.T
            # Woodbury's identity takes these frames out of the moments.
            wrong = wanted[left_out] - gone @ slopes
            slopes -= spread @ np.linalg.solve(np.eye(len(gone)) - gone @ spread, wrong)
            out.append(near @ slopes)
        return out

    return predict


def _gaps_of(hidden):
    """The columns of every gap in a mask (n_frames, n), by its first frame and the one after."""
    gaps = {}
    for column in np.flatnonzero(hidden.any(axis=0)).tolist():
        for first, end in runs_of(hidden[:, column]).tolist():
            gaps.setdefault((first, end), []).append(column)
    return gaps


def add_weights(arrays, weights):
    """Trials with a column of weights behind their features.

    Parameters
    ----------
    arrays : sequence of ndarray (n_frames_i, n_features)
    weights : sequence of ndarray (n_frames_i,), or None
        None: all have the weight 1.

    Returns
    -------
    list of ndarray (n_frames_i, n_features + 1)
    """
    if weights is None:
        weights = [np.ones(len(x)) for x in arrays]
    columns = (w[:, np.newaxis].astype(x.dtype) for x, w in zip(arrays, weights, strict=True))
    return [np.concatenate([x, w], axis=1) for x, w in zip(arrays, columns, strict=True)]


def _correlation_time(arrays):
    """Frames after which the correlation with later ones has fallen to 1 / e.

    Of arrays (n_frames_i, n_features), in standard units, with NaN where nothing was seen.
    """
    seen = [np.isfinite(z).astype(np.float64) for z in arrays]
    arrays = [np.where(s, z, 0) for z, s in zip(arrays, seen, strict=True)]
    squares = [np.square(z) for z in arrays]
    longest, lag, before = max(map(len, arrays), default=0), 1, 1.0
    while lag < longest:
        products = energy = 0.0
        for z, s, e in zip(arrays, seen, squares, strict=True):
            products += np.vdot(z[:-lag], z[lag:])
            energy += (np.vdot(e[:-lag], s[lag:]) + np.vdot(e[lag:], s[:-lag])) / 2
        now = products / energy if energy > CONSTANT else 1.0
        if now < 1 / np.e:
            if lag == 1:
                # Hardly any correlation.
                return float(-1 / np.log(max(now, 0.01)))
            return float(lag - lag / 2 * (1 / np.e - now) / (before - now))
        lag, before = 2 * lag, now
    # Trials shorter than that.
    return float(longest)


def _time_precision(n_frames, value_time, velocity_time):
    """The inverse of the correlations of frames: its diagonal, and the two below it, as rows.

    It is ``L' L`` of the lower triangular L that takes from each frame what the two before it tell,
    and divides by the standard deviation of the rest.
    """
    p, q = (np.exp(-1 / t) if t > 0 else 0.0 for t in (value_time, velocity_time))
    rest = (1 - p**2) * (1 - q**2)
    lower = np.empty((3, n_frames))
    lower[:] = np.array([[1], [-(p + q)], [p * q]]) / np.sqrt(rest * (1 - p * q) / (1 + p * q))
    lower[:, :1] = [[1], [0], [0]]
    lower[:, 1:2] = np.array([[1 + p * q], [-(p + q)], [0]]) / np.sqrt(rest)
    bands = np.zeros((3, n_frames))
    for k in range(3):
        for j in range(k, min(3, n_frames)):
            bands[k, : n_frames - j] += lower[j, j:] * lower[j - k, j:]
    return bands


def _unknown_step(bands, first, end):
    """The share that is unknown of the variance of a step in the middle of a gap.

    It is as long as the trellis smooths velocities.
    """
    n_frames = bands.shape[1]
    middle, reach = (first + end) // 2, max(1, round(SMOOTHING * n_frames))
    step = np.zeros(n_frames)
    step[[max(0, middle - reach), min(n_frames - 1, middle + reach)]] = -1, 1
    variances = []
    for rows in (slice(first, end), slice(None)):
        part = bands[: len(step[rows]), rows]
        variances.append(step[rows] @ solveh_banded(part, step[rows], lower=True))
    return variances[0] / variances[1]


def _solve(pulls, hidden, precision, bands):
    """Hidden values of frames, in the order of the mask, given all that was seen.

    The inverse covariance of all values is ``T x precision`` of frames and features, with a banded
    T: only frames near each other are coupled, and the equations are banded.
    """
    frame, feature = np.nonzero(hidden)
    before = np.concatenate([[0], np.cumsum(hidden.sum(axis=1))])
    width = int((before[len(bands) :] - before[: -len(bands)]).max(initial=0)) or len(frame)
    equations, n = np.zeros((width, len(frame))), len(frame)
    for k in range(min(width, n)):
        early, apart = frame[: n - k], frame[k:] - frame[: n - k]
        weight = np.where(apart < len(bands), bands[np.minimum(apart, len(bands) - 1), early], 0)
        equations[k, : n - k] = weight * precision[feature[k:], feature[: n - k]]
    return solveh_banded(
        equations, pulls[hidden], lower=True, overwrite_ab=True, check_finite=False
    )
