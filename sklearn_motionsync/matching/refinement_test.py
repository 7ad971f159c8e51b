"""Does refining help? It does if features that had no part in it agree better afterwards.

Trials of one source have one time for all of their features: a warp refined by some of them brings
the others together. People have a style in every feature: a warp refined by some follows
their style, and takes the others apart.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse.csgraph import connected_components
from scipy.special import stdtr

from .matcher import Matcher
from .refinement import MOST_STEPS, match_postures, refine_warps, slow_energy
from .warper import RefinedWarper, Warper

__all__ = ["RefinementTrial", "Verdict", "deal_features"]

# Features that correlate by more than this say the same; one of them must not judge another.
_SAME = 0.9
# Share of the energy below which a feature does not move.
_STILL = 1e-20
# Probability, at most, that refining is taken for a help where it is none.
_DOUBT = 0.003
# Degrees of freedom, and standard deviation of the logarithms, that are taken for granted.
_PRIOR = 2, 0.1
# Where refining helps a few steps of some tell: docs/method.md.
_GLIMPSE, _HOPELESS = 3, 0.1
# Warps matched by all features have seen the noise of those that judge: what that may be worth.
_SIGHT = 1.2


def deal_features(on_clock):
    """Deal features into two hands of about equal energy; those that say the same stay together.

    Parameters
    ----------
    on_clock : ndarray, shape (n_sequences, P, n_features)

    Returns
    -------
    list of ndarray of int
        Two hands, of all features that move; none if all of these say the same.
    """
    frames = on_clock.reshape(-1, on_clock.shape[2]).astype(np.float64)
    frames = frames - frames.mean(axis=0)
    energy = np.square(frames).sum(axis=0)
    moving = np.flatnonzero(energy > _STILL * energy.max(initial=0))
    if len(moving) < 2:
        return []
    frames = frames[:, moving] / np.sqrt(energy[moving])
    count, group_of = connected_components(np.abs(frames.T @ frames) > _SAME, directed=False)
    if count < 2:
        return []
    groups = [moving[group_of == k] for k in range(count)]
    weights = np.array([energy[group].sum() for group in groups])
    hands, loads = [[], []], np.zeros(2)
    for k in np.argsort(-weights, kind="stable"):
        hand = loads.argmin()
        hands[hand].extend(groups[k])
        loads[hand] += weights[k]
    return [np.sort(hand) for hand in hands]


class Verdict(NamedTuple):
    """What refining did to features that had no part in it.

    Attributes
    ----------
    ratio : float
        Misfit after refining by the shown features to that after matching by them, in geometric
        mean; NaN if there was nothing to compare.
    p_value : float
        Of a moderated t test of the logarithms of these ratios, that refining does not help.
    ratio_to_all : float
        The same to the misfit after matching by all features, those that judge among them; NaN if
        nobody asked for that.
    misfit : float
        Median share of the pattern's energy that is that misfit after matching by all features.
    """

    ratio: float = np.nan
    p_value: float = np.nan
    ratio_to_all: float = np.nan
    misfit: float = np.nan

    @property
    def is_hopeless(self):
        """Whether even a few steps of refining tell that it will not help; nothing to tell is."""
        return not self.p_value <= _HOPELESS

    @property
    def may_help(self):
        """Whether refining helps beyond doubt those who match by the features shown."""
        return self.p_value < _DOUBT

    @property
    def helps(self):
        """Whether it does, and is not worse than the sight of all features."""
        return self.may_help and self.ratio_to_all < _SIGHT

    @classmethod
    def of(cls, misfits, energy):
        """The verdict on misfits (3, n_sequences, 2), as of a trial of a pattern of this energy.

        Matched by all features, which may be NaN, by those shown, and refined.
        """
        misfit = float(np.median(misfits[0].sum(axis=1)) / energy)
        known = ~(misfits <= 0).any(axis=0)
        if not known.any():
            return cls(misfit=misfit)
        by_all, by_shown, refined = misfits[:, known]
        gain = np.log(refined / by_shown)
        return cls(
            ratio=float(np.exp(gain.mean())),
            p_value=_p_value(gain),
            ratio_to_all=float(np.exp(np.log(refined / by_all).mean())),
            misfit=misfit,
        )


def _p_value(gain):
    """Of a one-sided t test that the mean is not below 0.

    The variance is moderated: a few values may agree by accident, or a few good ones differ.
    """
    freedom, expected = _PRIOR
    variance = freedom * expected**2 + np.square(gain - gain.mean()).sum()
    freedom += len(gain) - 1
    return float(stdtr(freedom, gain.mean() / np.sqrt(variance / freedom / len(gain))))


@dataclass(frozen=True, eq=False)
class RefinementTrial(RefinedWarper):
    """A warper that finds out whether refining helps.

    Attributes
    ----------
    hands : list of ndarray of int
        Features in two hands, each of which judges warps that are made by the other.
    blind : list of Warper
        For each hand, the warper by the features of the other one; without exemplars.
    """

    hands: list
    blind: list

    @classmethod
    def of(cls, warper, source, positions, hands, noise_width, **settings):
        """The trial of a warper.

        Parameters
        ----------
        warper : Warper
        source : ndarray, shape (1, Q, n_features)
            The pattern at all positions.
        positions : ndarray, shape (n_sequences, Q, n_features)
            Some performances, from which the blind warpers learn.
        hands : list of ndarray of int
        noise_width : float
        **settings : dict
            Those of `Matcher.learn`.
        """
        blind = []
        for shown in hands[::-1]:
            # Without a metric: the features that judge would have had a part in it.
            features = warper.matcher.features.plain()
            matcher, _ = Matcher.learn(features, positions[:, :, shown], **settings)
            chosen, pattern = source[:, :, shown], warper.pattern[:, shown]
            blind.append(Warper.to_pattern(matcher, pattern, chosen, True, warper.warp_smoothing))
        return cls(**vars(warper), noise_width=noise_width, hands=hands, blind=blind)

    def glimpse(self, positions, rows):
        """As `misfits`, after a few steps of refining."""
        return self.misfits(positions, rows, _GLIMPSE)

    def misfits(self, positions, rows, steps=MOST_STEPS):
        """Misfits of every hand, by the features shown and refined: (2, n_sequences, 2)."""
        positions = positions[rows].astype(np.float64, copy=False)
        base, moving = self.postures(positions)
        reach = self.matcher.trellis.reach
        # Both hands are refined together, filled up with features that do not move.
        n, width = len(positions), max(map(len, self.hands))
        bases = np.zeros((2, len(base), width))
        curves = np.zeros((2, *moving.shape[:2], width))
        by_shown = np.empty((2, *moving.shape[:2]))
        for i, shown in enumerate(self.hands[::-1]):
            by_shown[i] = self.blind[i].voted(positions[:, :, shown])[1]
            bases[i, :, : len(shown)] = base[:, shown]
            curves[i, :, :, : len(shown)] = moving[:, :, shown]
        together = np.repeat(bases, n, axis=0), np.concatenate(curves), np.concatenate(by_shown)
        refined = refine_warps(*together, reach, self.noise_width, steps).reshape(by_shown.shape)
        return self._misfits_of(positions, np.stack([by_shown, refined]))

    def misfits_by_all(self, positions, rows):
        """The same by all features: (1, n_sequences, 2)."""
        positions = positions[rows].astype(np.float64, copy=False)
        times = self.voted(positions)[1]
        return self._misfits_of(positions, np.stack([times, times])[np.newaxis])

    def _misfits_of(self, positions, times):
        """Misfits of every hand at its times, (n_kinds, 2, n_sequences, P), of some kinds."""
        n_kinds, _, n_sequences, n_frames = times.shape
        out = np.empty((n_kinds, n_sequences, 2))
        for i, held in enumerate(self.hands):
            # Judged by postures as they are: smoothing them blurs what noise tells of time.
            postures = positions[:, :: self.matcher.features.subframes, held]
            postures = np.tile(postures, (n_kinds, 1, 1))
            matched = match_postures(postures, times[:, i].reshape(-1, n_frames))
            out[:, :, i] = slow_energy(self.pattern[:, held], matched).reshape(n_kinds, -1)
        return out
