"""A test whether refining by postures improves warps, by features that had no part in it.

Trials of one source have one time for all of their features: a warp refined by some of them brings
the others together. People have a style in every feature: a warp refined by some features follows
their style, and takes the others apart.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse.csgraph import connected_components
from scipy.special import stdtr

from .matcher import Matcher, RefinedWarper, Warper
from .refinement import MAX_STEPS, refine_warps, slow_energy

__all__ = ["RefinementTest", "Verdict", "split_features"]

# Features with a larger correlation are in one fold: they must not test each other.
_CORRELATED = 0.9
# Features with a smaller share of the energy are constant.
_CONSTANT = 1e-20
# Level of the test that refining does not improve warps.
_LEVEL = 0.003
# Degrees of freedom, and standard deviation of the logarithms, of the prior variance.
_PRIOR = 2, 0.1
# Steps and level of the first pass: docs/design.md.
_FIRST_STEPS, _FIRST_LEVEL = 3, 0.1
# Warps matched by all features have seen the noise of the test features: the ratio that allows.
_LARGEST_RATIO = 1.2


def split_features(on_clock):
    """Split features into two folds of about equal energy; correlated ones stay together.

    Parameters
    ----------
    on_clock : ndarray, shape (n_sequences, P, n_features)

    Returns
    -------
    list of ndarray of int
        Two folds, of all features that move; none if all of these are correlated.
    """
    frames = on_clock.reshape(-1, on_clock.shape[2]).astype(np.float64)
    frames = frames - frames.mean(axis=0)
    energy = np.square(frames).sum(axis=0)
    moving = np.flatnonzero(energy > _CONSTANT * energy.max(initial=0))
    if len(moving) < 2:
        return []
    frames = frames[:, moving] / np.sqrt(energy[moving])
    correlated = np.abs(frames.T @ frames) > _CORRELATED
    count, group_of = connected_components(correlated, directed=False)
    if count < 2:
        return []
    groups = [moving[group_of == k] for k in range(count)]
    weights = np.array([energy[group].sum() for group in groups])
    folds, loads = [[], []], np.zeros(2)
    for k in np.argsort(-weights, kind="stable"):
        fold = loads.argmin()
        folds[fold].extend(groups[k])
        loads[fold] += weights[k]
    return [np.sort(fold) for fold in folds]


class Verdict(NamedTuple):
    """The effect of refining on features that had no part in it.

    Attributes
    ----------
    ratio : float
        Misfit after refining by the other fold to that after matching by it, in geometric
        mean; NaN if there is nothing to compare.
    p_value : float
        Of a moderated t test of the logarithms of these ratios, that refining does not help.
    ratio_to_all : float
        The same to the misfit after matching by all features, the test features among them; NaN if
        not computed.
    misfit : float
        That misfit after matching by all features, as a median share of the pattern's energy.
    """

    ratio: float = np.nan
    p_value: float = np.nan
    ratio_to_all: float = np.nan
    misfit: float = np.nan

    @property
    def is_hopeless(self):
        """Whether the first pass rules out that refining helps; also if there is no p value."""
        return not self.p_value <= _FIRST_LEVEL

    @property
    def may_help(self):
        """Whether refining significantly improves warps matched by one fold."""
        return self.p_value < _LEVEL

    @property
    def helps(self):
        """Whether it does, and is not worse than matching by all features."""
        return self.may_help and self.ratio_to_all < _LARGEST_RATIO

    @classmethod
    def of(cls, misfits, energy):
        """The verdict on misfits (3, n_sequences, 2) for a pattern of this energy.

        Matched by all features, which may be NaN, by one fold, and refined.
        """
        misfit = float(np.median(misfits[0].sum(axis=1)) / energy)
        known = ~(misfits <= 0).any(axis=0)
        if not known.any():
            return cls(misfit=misfit)
        by_all, by_fold, refined = misfits[:, known]
        gain = np.log(refined / by_fold)
        # One-sided t test that the mean is not below 0. The variance is moderated by a prior: a
        # few values may agree by accident.
        freedom, expected = _PRIOR
        variance = freedom * expected**2 + np.square(gain - gain.mean()).sum()
        freedom += len(gain) - 1
        statistic = gain.mean() / np.sqrt(variance / freedom / len(gain))
        return cls(
            ratio=float(np.exp(gain.mean())),
            p_value=float(stdtr(freedom, statistic)),
            ratio_to_all=float(np.exp(np.log(refined / by_all).mean())),
            misfit=misfit,
        )


@dataclass(frozen=True, eq=False)
class RefinementTest(RefinedWarper):
    """A warper that measures the effect of refining.

    Attributes
    ----------
    folds : list of ndarray of int
        Two folds of features. Warps by one of them are tested by the other.
    fold_warpers : list of Warper
        For each fold, the warper by the features of the other one; without exemplars.
    """

    folds: list
    fold_warpers: list

    @classmethod
    def of(cls, warper, source, positions, folds, noise_width, **settings):
        """The test of a warper.

        Parameters
        ----------
        warper : Warper
        source : ndarray, shape (1, Q, n_features)
            The pattern at all positions.
        positions : ndarray, shape (n_sequences, Q, n_features)
            Performances from which the warpers by folds learn.
        folds : list of ndarray of int
        noise_width : float
        **settings : dict
            Those of `Matcher.learn`.
        """
        fold_warpers = []
        # Without a metric, which has been learnt from the test features, too.
        features = warper.matcher.features.replace(metric=None, anchors=None, weighs=False)
        for fold in folds[::-1]:
            matcher, _ = Matcher.learn(features, positions[:, :, fold], **settings)
            chosen, pattern = source[:, :, fold], warper.pattern[:, fold]
            smoothing = warper.warp_smoothing
            fold_warpers.append(Warper.to_pattern(matcher, pattern, chosen, True, smoothing))
        how = {"noise_width": noise_width, "folds": folds, "fold_warpers": fold_warpers}
        return cls(**vars(warper), **how)

    def misfits(self, positions, steps=MAX_STEPS):
        """Misfits of both folds, matched by the other fold and refined: (2, n_sequences, 2)."""
        positions = positions.astype(np.float64, copy=False)
        base, moving = self.postures(positions)
        reach = self.matcher.trellis.reach
        # Both folds are refined together, padded with constant features.
        n, width = len(positions), max(map(len, self.folds))
        bases = np.zeros((2, len(base), width))
        curves = np.zeros((2, *moving.shape[:2], width))
        by_fold = np.empty((2, *moving.shape[:2]))
        for i, fold in enumerate(self.folds[::-1]):
            by_fold[i] = self.fold_warpers[i].warps(positions[:, :, fold])[1]
            bases[i, :, : len(fold)] = base[:, fold]
            curves[i, :, :, : len(fold)] = moving[:, :, fold]
        together = np.repeat(bases, n, axis=0), np.concatenate(curves), np.concatenate(by_fold)
        refined = refine_warps(*together, reach, self.noise_width, steps).reshape(by_fold.shape)
        return self._misfits_of(positions, np.stack([by_fold, refined]))

    def first_misfits(self, positions):
        """The same after a few steps of refining."""
        return self.misfits(positions, _FIRST_STEPS)

    def misfits_by_all(self, positions):
        """Misfits of both folds, matched by all features: (1, n_sequences, 2)."""
        positions = positions.astype(np.float64, copy=False)
        times = Warper.warps(self, positions)[1]
        return self._misfits_of(positions, np.stack([times, times])[np.newaxis])

    def _misfits_of(self, positions, times):
        """Misfits of both folds for several warps (n_kinds, 2, n_sequences, P)."""
        n_kinds, _, n_sequences, n_frames = times.shape
        out = np.empty((n_kinds, n_sequences, 2))
        for i, fold in enumerate(self.folds):
            # By the given postures: smoothing them blurs the noise that follows the warp.
            postures = positions[:, :: self.matcher.features.subframes, fold]
            postures = np.tile(postures, (n_kinds, 1, 1))
            given = self.pattern[:, fold], postures, times[:, i].reshape(-1, n_frames)
            out[:, :, i] = slow_energy(*given).reshape(n_kinds, -1)
        return out
