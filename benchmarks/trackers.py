"""Peers of `MotionTracker`: linear-Gaussian filters and smoothers, and particles over postures.

They share no code with the package. All of them see takes ``(n_frames, n_features)`` in which NaN
is what is hidden and all else carries noise of one standard deviation, and tell the posture at
every frame. What they have to know they learn from ``people``, lists of whole takes, one list a
person; settings of which the best is to be chosen on people left out of these are named here.
"""

from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.linalg.lapack import dposv

# What keeps covariances of features that never move invertible: a twentieth of a degree.
LEAST, TINY = 1e-6, 1e-9
# Of the rate of particles over postures so much is left after a frame, a third after half a second.
RATE_KEPT = np.exp(-1 / 15)
# Settings that are tried; length scales are in frames.
LENGTHS = (5, 8, 12, 18, 27)
SHARES = (0.1, 0.25, 0.5)
RIDGES = (0.01, 0.1, 1, 10, 100)
FACTORS = (0.01, 0.1, 1, 10)

# -- the filter and the smoother --------------------------------------------------------


class Linear(NamedTuple):
    """``x' = transition x + N(0, drive)`` from N(start, spread); its first entries are seen."""

    transition: np.ndarray
    drive: np.ndarray
    start: np.ndarray
    spread: np.ndarray


class Estimates(NamedTuple):
    """What of the state can be seen: means and variances of the filter, means of the smoother."""

    means: np.ndarray
    variances: np.ndarray
    smoothed: np.ndarray | None


def kalman(model, y, noise, smooth=False, shows=None):
    """Filter a take ``y`` (n_frames, d), NaN where hidden; smooth it by the pass of Rauch.

    ``noise`` is a standard deviation or a covariance; ``shows`` are rows of a matrix by which a
    posture is seen, if it is not seen as it is.
    """
    F, n = model.transition, y.shape[1]
    shows = np.eye(n) if shows is None else shows
    d, R = shows.shape[1], noise if np.ndim(noise) else noise**2 * np.eye(n)
    before, after = [], []
    x, P = model.start, model.spread
    for t, row in enumerate(y):
        if t:
            x, P = F @ x, F @ (F @ P).T + model.drive
        before.append((x, P))
        seen = np.flatnonzero(~np.isnan(row))
        if len(seen):
            rows = shows[seen]
            across = P[:, :d] @ rows.T
            gain = _solved(rows @ across[:d] + R[np.ix_(seen, seen)], across.T)
            x, P = x + (row[seen] - rows @ x[:d]) @ gain, _symmetric(P - across @ gain)
        after.append((x, P))
    means = np.stack([x[:d] for x, _ in after])
    variances = np.stack([np.diag(P)[:d] for _, P in after])
    return Estimates(means, variances, _backwards(F, before, after)[:, :d] if smooth else None)


def _gain(P, seen, noise):
    """Transposed: what a row of the seen adds to the state."""
    if not len(seen):
        return np.zeros((0, len(P)))
    return _solved(P[np.ix_(seen, seen)] + noise**2 * np.eye(len(seen)), P[seen])


def _symmetric(C):
    return (C + C.T) / 2


def _solved(C, right):
    """Of a covariance and a right side, by Cholesky's way."""
    _, answer, failed = dposv(C, right)
    if failed:
        raise np.linalg.LinAlgError("A covariance is not positive definite.")
    return answer


def _backwards(F, before, after):
    """Means of the states given all frames."""
    states, back = [after[-1][0]], F.T
    for (x, P), (ahead, spread) in zip(after[-2::-1], before[:0:-1], strict=True):
        states.append(x + P @ (back @ _solved(spread, states[-1] - ahead)))
    return np.array(states[::-1])


def log_likelihood(model, takes, noise):
    """Log-density of whole takes, nothing hidden, which share their covariances."""
    F, d = model.transition, takes[0].shape[1]
    ends, total = np.array([len(x) for x in takes]), 0.0
    y = np.stack([np.pad(x, ((0, ends.max() - len(x)), (0, 0))) for x in takes])
    x, P, seen = np.tile(model.start, (len(takes), 1)), model.spread, np.arange(d)
    for t in range(ends.max()):
        if t:
            x, P = (F @ x.T).T, F @ (F @ P).T + model.drive
        error = (y[:, t] - x[:, :d])[ends > t]
        S = P[:d, :d] + noise**2 * np.eye(d)
        far = (error * np.linalg.solve(S, error.T).T).sum()
        total -= 0.5 * (far + len(error) * (np.linalg.slogdet(S)[1] + d * np.log(2 * np.pi)))
        gain = _gain(P, seen, noise)
        x, P = x + (y[:, t] - x[:, :d]) @ gain, _symmetric(P - P[:, :d] @ gain)
    return total


# -- what is learnt ---------------------------------------------------------------------


class Peer(NamedTuple):
    """A mean posture and a linear model of what deviates from it."""

    mean: np.ndarray
    model: Linear

    def run(self, takes, noise, paths=None, smooth=True, shows=None):
        """Estimates of takes; ``paths``: a mean of its own at every frame of each."""
        about = paths or [np.broadcast_to(self.mean, (len(x), len(self.mean))) for x in takes]
        found = []
        for x, m in zip(takes, about, strict=True):
            off = x - (m if shows is None else m @ shows.T)
            found.append((m, kalman(self.model, off, noise, smooth, shows)))
        return [
            Estimates(m + e.means, e.variances, m + e.smoothed if smooth else None)
            for m, e in found
        ]

    def likelihood(self, takes, noise):
        """Log-density of whole takes."""
        return log_likelihood(self.model, [x - self.mean for x in takes], noise)


def moments_of(takes):
    """Mean and covariance of all frames."""
    frames = np.concatenate(takes)
    return frames.mean(axis=0), np.cov(frames.T, bias=True) + LEAST * np.eye(frames.shape[1])


def all_but(people, k=None):
    return [x for i, takes in enumerate(people) if i != k for x in takes]


def noisy(takes, noise, rng):
    return [x + noise * rng.standard_normal(x.shape) for x in takes]


def imputation(takes, seen, noise):
    """Each frame of ``seen`` takes by itself, given the pooled postures of ``takes``."""
    mean, C = moments_of(takes)
    found = []
    for x in seen:
        estimate = np.tile(mean, (len(x), 1))
        masks, of = np.unique(~np.isnan(x), axis=0, return_inverse=True)
        for k, mask in enumerate(masks):
            columns, rows = np.flatnonzero(mask), np.flatnonzero(of.ravel() == k)
            errors = x[np.ix_(rows, columns)] - mean[columns]
            estimate[rows] += errors @ _gain(C, columns, noise)
        found.append(estimate)
    return found


def constant_velocity(takes, factor):
    """White acceleration of each feature by itself: its share of what the takes' differences show.

    It begins as any frame of theirs. (As their first frames: worse on bends, tried on one seed.)
    """
    mean, C = moments_of(takes)
    _, V = moments_of([np.diff(x, axis=0) for x in takes])
    _, A = moments_of([np.diff(x, 2, axis=0) for x in takes])
    power = factor * np.diag(np.diag(A))
    drive = np.kron([[1 / 3, 1 / 2], [1 / 2, 1]], power) + TINY * np.eye(2 * len(mean))
    spread = np.diag(np.concatenate([np.diag(C), np.diag(V)]))
    F = sparse.csr_array(np.kron([[1, 1], [0, 1]], np.eye(len(mean))))
    return Peer(mean, Linear(F, drive, np.zeros(len(spread)), spread))


def autoregression(takes, ridge):
    """VAR(2): a posture from the two before it, by ridge regression about the pooled mean."""
    mean, _ = moments_of(takes)
    pairs = [(np.hstack([x[1:-1], x[:-2]]) - np.tile(mean, 2), x[2:] - mean) for x in takes]
    X, y = (np.concatenate(part) for part in zip(*pairs, strict=True))
    d = len(mean)
    F = np.eye(2 * d, k=-d)
    F[:d] = np.linalg.solve(X.T @ X + ridge * np.eye(2 * d), X.T @ y).T
    # A gap of a second must not blow up.
    F[:d] *= min(1.0, 0.999 / np.abs(np.linalg.eigvals(F)).max())
    residuals = y - X @ F[:d].T
    drive = TINY * np.eye(2 * d)
    drive[:d, :d] += residuals.T @ residuals / len(y) + LEAST * np.eye(d)
    spread = X.T @ X / len(X) + LEAST * np.eye(2 * d)
    return Peer(mean, Linear(F, drive, np.zeros(2 * d), spread))


def matern(mean, C, length, share):
    """A Matern-3/2 process in time of this length scale, covariance drawn to its diagonal."""
    rate, d = np.sqrt(3) / length, len(C)
    f = np.exp(-rate) * np.array([[1 + rate, 1], [-(rate**2), 1 - rate]])
    rest = np.diag([1, rate**2])
    C = (1 - share) * C + share * np.diag(np.diag(C))
    drive = np.kron(rest - f @ rest @ f.T, C) + TINY * np.eye(2 * d)
    F = sparse.csr_array(np.kron(f, np.eye(d)))
    return Peer(mean, Linear(F, drive, np.zeros(2 * d), np.kron(rest, C)))


def pooled_matern(takes, length, share):
    """That process about the pooled mean posture: it knows no phase."""
    return matern(*moments_of(takes), length, share)


def deviation_process(deviations, noise, share=0.5):
    """That process as it is most likely of deviations whose mean is meant to be none."""
    frames = np.concatenate(deviations)
    C = frames.T @ frames / len(frames) + LEAST * np.eye(frames.shape[1])
    given = noisy(deviations, noise, np.random.default_rng(0))
    peers = [matern(np.zeros(len(C)), C, length, share) for length in LENGTHS]
    return peers[int(np.argmax([peer.likelihood(given, noise) for peer in peers]))]


# -- particles over postures ------------------------------------------------------------


class PostureParticles:
    """A bootstrap filter whose particles are postures of the envelope, each with a phase.

    Phase goes on at a rate that does a random walk; the posture, a point of the space of 95 % of
    the variance, deviates from the mean at its phase by an autoregression with the variance that
    people show there, three standard deviations at most; weights are likelihoods of what is seen.
    With ``prunes`` the posture goes on by the step of the mean and by chance, and a hypothesis that
    leaves the envelope is rejected, as the paper proposes it.
    """

    def __init__(self, warped, takes, paces, noise, n_particles=500, prunes=False):
        self.noise, self.n, self.prunes = noise, n_particles, prunes
        self.centre, C = moments_of(takes)
        values, axes = np.linalg.eigh(C)
        values, axes = values[::-1], axes[:, ::-1]
        kept = int(np.searchsorted(np.cumsum(values) / values.sum(), 0.95)) + 1
        self.axes = axes[:, :kept].T
        self.residual = np.maximum(np.diag(C) - values[:kept] @ self.axes**2, 0)
        points = (warped - self.centre) @ self.axes.T
        self.mean, self.std = points.mean(axis=0), points.std(axis=0, ddof=1)
        deviations = points - self.mean
        self.kept = self._persistence(deviations, np.exp(paces.mean()))
        self.pace, self.spread = paces.mean(), paces.std()

    def _persistence(self, deviations, pace):
        """How much of a deviation is left after a frame: a frame of the clock's, to the pace."""
        a, b = deviations[:, :-1].ravel(), deviations[:, 1:].ravel()
        return min(abs(a @ b / (a @ a)), 0.999) ** pace

    def run(self, takes, rng):
        """Postures of takes, at every frame by what was seen up to it."""
        longest = max(map(len, takes))
        y = [np.pad(x, ((0, longest - len(x)), (0, 0)), constant_values=np.nan) for x in takes]
        y = np.stack(y) - self.centre
        state = self._begin(len(takes), rng)
        log_weights, out = np.zeros((len(takes), self.n)), []
        for t in range(longest):
            if t:
                state = self._go_on(*state, rng)
            x = state[0]
            log_weights = log_weights + self._log_likelihood(x, y[:, t])
            if self.prunes:
                log_weights = self._pruned(log_weights, *state[:3])
            weights = np.exp(log_weights - log_weights.max(axis=1, keepdims=True))
            weights /= weights.sum(axis=1, keepdims=True)
            out.append((weights[..., None] * x).sum(axis=1) @ self.axes + self.centre)
            drawn, log_weights = self._draw(weights, rng)
            rows = np.arange(len(takes))[:, None]
            state = [part[rows, drawn] for part in state]
        means = np.stack(out, axis=1)
        return [means[i, : len(take)] for i, take in enumerate(takes)]

    def _begin(self, k, rng):
        """Points, the means that they deviate from, phases and log rates of k takes."""
        log_rates = self.pace + self.spread * rng.standard_normal((k, self.n))
        about = np.broadcast_to(self.mean[0], (k, self.n, self.mean.shape[1]))
        x = about + self.std[0] * rng.standard_normal(about.shape)
        return x, about, np.zeros((k, self.n)), log_rates

    def _go_on(self, x, about, phases, log_rates, rng):
        """A frame later."""
        log_rates = self.pace + RATE_KEPT * (log_rates - self.pace)
        pushed = np.sqrt(1 - RATE_KEPT**2) * self.spread
        log_rates = log_rates + pushed * rng.standard_normal(phases.shape)
        phases = np.minimum(phases + np.exp(log_rates), len(self.mean) - 1)
        at = np.rint(phases).astype(int)
        std, fresh = self.std[at], np.sqrt(1 - self.kept**2) * rng.standard_normal(x.shape)
        if self.prunes:
            return self.mean[at] + x - about + std * fresh, self.mean[at], phases, log_rates
        deviations = np.clip(self.kept * (x - about) + std * fresh, -3 * std, 3 * std)
        return self.mean[at] + deviations, self.mean[at], phases, log_rates

    def _pruned(self, log_weights, x, about, phases):
        """None of a take's hypotheses is left outside of the envelope, if there are others."""
        std = self.std[np.rint(phases).astype(int)]
        inside = (np.abs(x - about) <= 3 * std).all(axis=2)
        inside |= ~inside.any(axis=1, keepdims=True)
        return np.where(inside, log_weights, -np.inf)

    def _log_likelihood(self, x, y):
        """|y - x axes|^2 of what is seen, in units of noise and what the space leaves out."""
        seen = ~np.isnan(y)
        scaled = seen[:, None] * self.axes / (self.noise**2 + self.residual)
        pull = scaled @ np.where(seen, y, 0.0)[..., None]
        return (x @ pull)[..., 0] - 0.5 * (x @ (scaled @ self.axes.T) * x).sum(axis=-1)

    def _draw(self, weights, rng):
        """Those that go on, drawn anew where less than half tell anything, and log-weights."""
        drawn = _systematic(weights, rng)
        rich = 1 / (weights**2).sum(axis=1) >= self.n / 2
        drawn[rich] = np.arange(self.n)
        return drawn, np.where(rich[:, None], np.log(weights + 1e-300), 0.0)


def _systematic(weights, rng):
    """Indices of as many particles, drawn by weight at even distances."""
    k, n = weights.shape
    points = (rng.random((k, 1)) + np.arange(n)) / n
    sums = np.cumsum(weights, axis=1)
    return np.minimum([np.searchsorted(s, p) for s, p in zip(sums, points, strict=True)], n - 1)
