"""Slow and obvious versions of the matching. They share no code with the package."""

import functools
import itertools

import numpy as np

# Of every cost of the package: b, g and phi of a step at the local rate rho, as in docs/method.md,
# and the features, given positions a frame and the width of the filter in positions.
STEP_WEIGHTS = {
    "pose": lambda rho: (1.0, 2.0, abs(rho - 1)),
    "velocity": lambda rho: ((0.8 + 0.2 * rho) ** 2, 1.6 + 0.4 * rho, (rho - 1) ** 2),
    "elastic": lambda rho: (rho, 2 * rho**0.5, (rho - 1) ** 2),
}
FEATURES = {
    "pose": lambda x, pace, sigma: x,
    "velocity": lambda x, pace, sigma: pace * slow_filter(x, sigma, 1),
    "elastic": lambda x, pace, sigma: slow_roots(pace * slow_filter(x, sigma, 1)),
}


def slow_roots(velocity):
    """q = v / sqrt(|v|)."""
    return np.array([v / np.sqrt(np.linalg.norm(v)) for v in velocity])


def step_costs(cost, max_rate, subframes):
    """(b, g, phi) of every admissible step."""
    steps = range(int(max_rate * subframes) + 1)
    return {s: STEP_WEIGHTS[cost](s / subframes) for s in steps}


def path_cost(x, y, path, costs, mu, subframes):
    """Cost of one path of positions: the sum as it stands in the paper (Eq. 12)."""
    total = 0.0
    for p, q in enumerate(path):
        step = subframes if p == 0 else q - path[p - 1]
        b, g, phi = costs[step]
        total += x[p] @ x[p] + b * (y[q] @ y[q]) - g * (x[p] @ y[q])
        total += 0.0 if p == 0 else mu * phi
    return total


def all_free_paths(n_frames, steps, subframes, max_disparity):
    """Every path that stays in the band, wherever it begins and ends."""
    reach = max_disparity * subframes
    for start, *taken in itertools.product(range(-reach, reach + 1), *[steps] * (n_frames - 1)):
        path = reach + start + np.concatenate([[0], np.cumsum(taken)]).astype(int)
        if np.abs(path - reach - subframes * np.arange(n_frames)).max() <= reach:
            yield path


def all_paths(n_frames, steps, subframes, max_disparity):
    """Every path with pinned ends that stays in the band."""
    last = (n_frames - 1) * subframes
    for taken in itertools.product(steps, repeat=n_frames - 1):
        path = np.concatenate([[0], np.cumsum(taken)]).astype(int)
        offsets = path - subframes * np.arange(n_frames)
        if path[-1] == last and np.abs(offsets).max() <= max_disparity * subframes:
            yield path


# Finding the paths takes longer than adding up their costs.
@functools.cache
def known_paths(n_frames, steps, subframes, max_disparity):
    return list(all_paths(n_frames, steps, subframes, max_disparity))


def brute_force(x, y, costs, mu, subframes, max_disparity):
    """Smallest cost, and every path that has it but for rounding."""
    paths = known_paths(len(x), tuple(sorted(costs)), subframes, max_disparity)
    totals = np.array([path_cost(x, y, path, costs, mu, subframes) for path in paths])
    best = totals.min()
    near = totals <= best + 1e-9 * max(1.0, abs(best))
    return best, [tuple(path) for path, is_near in zip(paths, near, strict=True) if is_near]


def plain_loops(x, y, costs, mu, subframes, max_disparity):
    """Smallest cost by the recurrence of Eq. 16, one cell at a time."""
    n_frames, last = len(x), (len(x) - 1) * subframes
    reach = max_disparity * subframes

    def local(p, q, step):
        b, g, _ = costs[step]
        return x[p] @ x[p] + b * (y[q] @ y[q]) - g * (x[p] @ y[q])

    row = {0: local(0, 0, subframes)}
    for p in range(1, n_frames):
        new = {}
        for q in range(max(0, p * subframes - reach), min(last, p * subframes + reach) + 1):
            ways = [
                row[q - step] + local(p, q, step) + mu * costs[step][2]
                for step in costs
                if q - step in row
            ]
            if ways:
                new[q] = min(ways)
        row = new
    return row[last]


def slow_filter(x, sigma, order):
    """A sampled Gaussian, or its derivative, by explicit sums over the point reflections."""
    n = len(x)
    reach = min(int(np.ceil(4 * sigma)) + 1, n - 1)
    sigma = max(sigma, 1 / 3)
    k = np.arange(-int(4 * sigma + 0.5), int(4 * sigma + 0.5) + 1)
    kernel = np.exp(-0.5 * (k / sigma) ** 2)
    kernel /= kernel.sum()
    kernel *= (1, k / sigma**2, k**2 / sigma**4 - 1 / sigma**2)[order]

    def at(i):
        i = min(max(i, -reach), n - 1 + reach)
        if i < 0:
            return 2 * x[0] - x[-i]
        return x[i] if i < n else 2 * x[-1] - x[2 * (n - 1) - i]

    return np.array([sum(w * at(i + j) for w, j in zip(kernel, k, strict=True)) for i in range(n)])
