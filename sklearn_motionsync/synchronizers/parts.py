"""PartSynchronizer: every part of the body with a warp of its own, drawn to the whole body's."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from numbers import Real

import numpy as np
import pandas as pd
from sklearn.utils._param_validation import Interval

from ..body.parts import parts_of_names, parts_of_postures
from ..inputs.features import choose_features
from ..inputs.validation import names_of_input
from ..matching.matcher import Matcher, Warper
from ..matching.trellis import Coupling
from ..matching.warps import evaluate_warps, normalise
from ..utils.atomic import snapshot
from ..utils.parallel import run
from .dense import DenseSynchronizer
from .lags import Lags
from .match import Match
from .portions import warp_in_portions

__all__ = ["PartSynchronizer"]


class PartSynchronizer(DenseSynchronizer):
    """Synchronise the parts of the body, each by a warp of its own that is drawn to the body's.

    Nobody's arm keeps in step with the rest exactly. One warp for the whole body leaves that in
    the postures; here it is taken out, part by part, and told: ``lags``.

    1. The whole body is matched to the pattern, as `DenseSynchronizer` does: tau_body.
    2. Each part is matched by its own features, as they count in the learnt metric, to the same
       pattern by way of the same exemplars. What is added to the local cost of Eq. 12 draws it to
       the body::

           lambda (d - d_body)^2

       where d_body is the body's offset between the same two, and lambda is ``coupling`` times the
       mean squared norm of the part's features, d being in per cent of the clock.
    3. ``transform`` samples every part at its own times; features in no part follow the body.

    Parameters
    ----------
    parts : dict of str to features, default=None
        What belongs together: by name, one feature or several, by index or name, none of them
        twice. By default both arms, both legs and the trunk, if the features are those of
        `DirectionCosines`: called like them, or whole postures without names. Of other features
        there are then no parts, and all follow the body. ``Skeleton.parts()`` gives them for part
        of a body. A part of joint positions is named by its columns.
    coupling : float, default=0.001
        How strongly parts are drawn to the body, a pure number: 0 leaves each by itself, infinity
        makes all follow the body. Useful from 0.0001 to 0.01; 0 to measure lags of parts that move
        clearly.
    n_frames, pattern, velocity_smoothing, refine, max_offset, metric, consensus, warp_smoothing, \
cost, smoothness, max_rate, subframes, search, max_fit, random_state, n_jobs, verbose
        As of `DenseSynchronizer`, for the body and its parts. ``refine`` is for the body only.

    Attributes
    ----------
    parts_ : dict of str to ndarray of int
        Indices of the features of every part.
    pattern_, pattern_index_, n_frames_, global_distances_, certified_, n_matches_, search_, \
sample_, typical_share_, metric_, mu_, exemplars_, misfit_, refinement_, refines_, \
n_features_in_, feature_names_in_
        Of the whole body, as of `DenseSynchronizer`.

    See Also
    --------
    DenseSynchronizer : One warp for the whole body.
    LagDisplay : Draws the lags.

    Notes
    -----
    ``match`` is the body's: scorers and displays see what they see of a `DenseSynchronizer`.

    A part that hardly moves, such as the idle arm of a grab, has no timing that could be told:
    without coupling its warp is chance, and so is its lag. `Lags.summary` shows it by its spread.
    What falls with the coupling is its distance from the body on average; a single performance of
    it may jump.

    References
    ----------
    A. Nakazawa, S. Nakaoka, K. Ikeuchi, "Matching and Blending Human Motions Using Temporal
    Scaleable Dynamic Programming", IROS 2004.

    Examples
    --------
    The right arm of the last of six bends is late, by 5 % of its time in the middle.

    >>> import numpy as np
    >>> from sklearn_motionsync import DirectionCosines, PartSynchronizer
    >>> from sklearn_motionsync.datasets import make_bending
    >>> bunch = make_bending(6, n_frames=100, random_state=0)
    >>> X = DirectionCosines(bunch.skeleton).fit_transform(bunch.data)
    >>> sync = PartSynchronizer(n_frames=100, pattern=0, coupling=0).fit(X)
    >>> t, last = np.linspace(0, 1, len(X[5])), X[5].copy()
    >>> for k in sync.parts_["right arm"]:
    ...     last[:, k] = np.interp(t - 0.05 * np.sin(np.pi * t) ** 2, t, X[5][:, k])
    >>> lags = sync.lags([X[5], last], unit="percent")
    >>> change = lags.values[1] - lags.values[0]
    >>> dict(zip(lags.parts, change.max(axis=1).round(1).tolist()))
    {'left arm': 0.0, 'right arm': 5.1, 'left leg': 0.2, 'right leg': 0.8, 'trunk': 0.2}
    """

    _parameter_constraints: dict = {
        **DenseSynchronizer._parameter_constraints,
        "parts": [Mapping, None],
        "coupling": [Interval(Real, 0, None, closed="both")],
    }

    def __init__(
        self,
        parts=None,
        coupling=0.001,
        *,
        n_frames=None,
        pattern="median",
        velocity_smoothing="auto",
        refine="auto",
        max_offset="auto",
        metric="learned",
        consensus=8,
        warp_smoothing=0.02,
        cost="velocity",
        smoothness=0.003,
        max_rate=4,
        subframes=1,
        search="auto",
        max_fit=None,
        random_state=0,
        n_jobs=None,
        verbose=0,
    ):
        super().__init__(
            n_frames,
            pattern,
            velocity_smoothing=velocity_smoothing,
            refine=refine,
            max_offset=max_offset,
            metric=metric,
            consensus=consensus,
            warp_smoothing=warp_smoothing,
            cost=cost,
            smoothness=smoothness,
            max_rate=max_rate,
            subframes=subframes,
            search=search,
            max_fit=max_fit,
            random_state=random_state,
            n_jobs=n_jobs,
            verbose=verbose,
        )
        self.parts = parts
        self.coupling = coupling

    def transform(self, X):
        """Warp every part onto the clock of the pattern, by its own warp (Eq. 18).

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array

        Returns
        -------
        ndarray, shape (n_sequences, P, n_features)
            ``(n_sequences, P)`` for 2-D input; a ``(performance, frame)`` frame under
            ``set_output(transform="pandas")``.
        """
        return self._warp(X)

    def _warp_part(self, performances):
        body = self.match(performances)
        out = body.warp(performances)
        for name, match in self._match_parts(performances, body, "part").items():
            columns = self.parts_[name]
            out[:, :, columns] = match.warp([x[:, columns] for x in performances])
        return out

    @snapshot
    def match_parts(self, X):
        """Match every part of performances to that of the pattern.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array

        Returns
        -------
        dict of str to Match
            By part, as ``match`` gives it of the whole body. ``distances`` are those of the part's
            own features, without the coupling; NaN of parts that only follow the body.
        """
        performances = self.check_performances(X)
        return self._match_parts(performances, self.match(performances), "part")

    @snapshot
    def lags(self, X, groups=None, *, against="rest", unit="frames", frame_rate=None):
        """How much later than the rest of the body each part is, at every frame of the pattern.

        Parameters
        ----------
        X : list of arrays (n_frames_i, n_features), 3-D array, or 2-D array
        groups : array-like of shape (n_sequences,), default=None
            Who each performance is of: then the spread is told within and between people.
        against : {"rest", "body"} or name of a part, default="rest"
            Later than what. ``"rest"``: than the body without the part, which is matched by
            itself; where that does not move, or is nothing, than the whole body. ``"body"``: than
            the whole body, which a part that moves most takes along. A name: than that part.
        unit : {"frames", "percent", "seconds"}, default="frames"
            Of the lags, as in ``Match.offsets_in``.
        frame_rate : float, or array-like of shape (n_sequences,), default=None
            For seconds: frames a second of X.

        Returns
        -------
        Lags

        Raises
        ------
        ValueError
            If there are no parts, or not the one to compare with, or not one of the groups a
            performance.
        """
        performances = self.check_performances(X)
        self._check_lags(against)
        groups, people = people_of(groups, len(performances))
        body = self.match(performances)
        parts = self._match_parts(performances, body, "part")
        others = dict.fromkeys(parts, parts.get(against, body))
        if against == "rest":
            others = self._match_parts(performances, body, "rest")
        lengths = [len(x) for x in performances]
        values = np.stack(
            [
                match.offsets_in(unit, lengths, frame_rate)
                - others[name].offsets_in(unit, lengths, frame_rate)
                for name, match in parts.items()
                if name != against
            ],
            axis=1,
        )
        names = [name for name in parts if name != against]
        return Lags(values, names, against, unit, groups, people, performances.labels)

    def _learn(self, performances):
        parts = choose_parts(self.parts, performances, names_of_input(self))
        super()._learn(performances)
        self.parts_, self._warpers = parts, self._learn_parts(performances, parts)

    def _learn_parts(self, performances, parts):
        """The warper of every part, and of the rest without it; of some that move."""
        if not parts or self.coupling == math.inf:
            return {}
        source = self._given_pattern(performances)
        if source is None:
            source = performances[self.pattern_index_]
        chosen = [source, *(performances[k] for k in self.exemplars_)]
        # In double precision, as all that is warped.
        chosen = [x.astype(np.float64, copy=False) for x in chosen]
        chosen = normalise(chosen, self.n_frames_, self.subframes)
        (times,) = run(_warps_of_bodies, [(self._warper, chosen)])
        training = normalise(performances, self.n_frames_, self.subframes)
        own = self._warper, times, training, chosen, self.coupling, self._settings()
        columns = {(name, "part"): of_part for name, of_part in parts.items()}
        everything = np.arange(performances[0].shape[1])
        columns |= {(name, "rest"): np.setdiff1d(everything, x) for name, x in parts.items()}
        portions = [(x, *own) for x in columns.values()]
        warpers = run(PartWarper.of, portions, n_jobs=self.n_jobs, prefer="threads")
        return {key: w for key, w in zip(columns, warpers, strict=True) if w is not None}

    def _match_parts(self, performances, body, what):
        """A match by part: of the part, or of the rest without it."""
        found = {}
        with self._progress(fits=False) as progress:
            for name in self.parts_:
                warper = self._warpers.get((name, what))
                if warper is None:
                    found[name] = Match(body.times)
                    continue
                portions = {"n_jobs": self.n_jobs, "progress": progress, "name": f"warping {name}"}
                distances, times = warp_in_portions(warper, performances, body.times, **portions)
                found[name] = Match(times, warper.matcher.features.back(distances))
        return found

    def _check_lags(self, against):
        if not self.parts_:
            why = "the features are not known to be those of DirectionCosines"
            if self.parts is not None:
                why = f"parts={self.parts!r} names none"
            raise ValueError(
                f"There are no parts that could lag: {why}. Fit again, and give parts={{name: "
                "features}; skeleton.parts() has them of direction cosines."
            )
        known = ["rest", "body", *self.parts_]
        if not (isinstance(against, str) and against in known):
            raise ValueError(f"against must be one of {known}, got {against!r}.")
        if len(self.parts_) == 1 and against in self.parts_:
            raise ValueError(f"{against!r} is the only part: use against='rest' or 'body'.")


def _warps_of_bodies(warper, chosen):
    """The body's warps of the pattern and its exemplars, of which the first keeps its own pace."""
    times = warper.warps(warper.matcher.features.unit(chosen))[1]
    times[0] = np.arange(times.shape[1])
    return times


# -- which features are a part of the body, and who performs: what users call by name ----

# What a part is compared with cannot be its name.
_TAKEN = ("rest", "body")


def choose_parts(parts, performances, names):
    """Indices of the features of every part, by its name.

    Parameters
    ----------
    parts : mapping of str to features, or None
        As a user gave them; None for those that the names, or the postures, tell.
    performances : Performances
    names : sequence or None
        Of their features.
    """
    if parts is None:
        found = parts_of_postures(performances) if names is None else parts_of_names(names)
        return {name: np.array(features) for name, features in found.items()}
    width = performances[0].shape[1]
    names = [f"x{i}" for i in range(width)] if names is None else [*names]
    chosen, owner = {}, {}
    for part, features in parts.items():
        if not isinstance(part, str) or part in _TAKEN:
            raise ValueError(
                f"A part must have a name, and not {' or '.join(map(repr, _TAKEN))}; got {part!r}."
            )
        try:
            indices = choose_features([] if features is None else features, names)
        except ValueError as error:
            raise ValueError(f"Part {part!r}: {error}") from None
        for k in indices:
            if k in owner:
                raise ValueError(
                    f"Feature {names[k]!r} is in part {owner[k]!r} and again in {part!r}: it can "
                    "be warped once only. Give it to one of them, once."
                )
            owner[k] = part
        chosen[part] = np.array(indices, dtype=np.intp)
    return chosen


def people_of(groups, n_sequences):
    """The person of every performance counted from 0, and what they are called; None for none."""
    if groups is None:
        return None, None
    given = (
        groups if isinstance(groups, (pd.Series, pd.Index)) else np.asarray(groups, dtype=object)
    )
    if given.ndim != 1 or len(given) != n_sequences:
        raise ValueError(
            f"groups must be one for each of the {n_sequences} performances, got shape "
            f"{np.shape(given)}."
        )
    codes, people = pd.factorize(given)
    if (codes < 0).any():
        i = int(np.argmin(codes))
        raise ValueError(
            f"Performance {i}: its group is missing, {list(given)[i]!r}. Say whose it is, or leave "
            "it out."
        )
    return codes, list(people)


# -- parts: some features of the body alone, with warps of their own that are drawn to the body's

# So strong a coupling leaves a part nothing; a stronger one is beyond numbers.
_RIGID = 1e6


@dataclass(frozen=True, eq=False)
class PartWarper(Warper):
    """Warps some features to the same pattern, by way of the same exemplars, as the whole body.

    Attributes
    ----------
    columns : ndarray of int
        The features.
    weight : float
        Of the coupling, in squared features of a frame by the square of a frame.
    back : ndarray, shape (1 + n_exemplars, P)
        The body's warps of the bases, inverted: what frame of the pattern their frames meet.
    """

    columns: np.ndarray
    weight: float
    back: np.ndarray

    @classmethod
    def of(cls, columns, body, times, on_clock, chosen, coupling, settings):
        """The warper of a part; None if the part does not move.

        Parameters
        ----------
        columns : ndarray of int
            Features of the part.
        body : Warper
            Of the whole body.
        times : ndarray, shape (1 + n_exemplars, P)
            The body's warps of the pattern and its exemplars.
        on_clock, chosen : ndarray, shape (n_sequences, Q, n_features)
            The training set, and the pattern and its exemplars in double precision: whole, at all
            positions, not in the unit.
        coupling : float
            ``lambda``, in mean squared features of the part, by the square of a per cent of the
            clock.
        settings : dict
            As `Matcher.learn` takes them.
        """
        features = body.matcher.features.part(columns, on_clock)
        if features is None:
            return None
        positions = features.unit(on_clock[:, :, columns])
        matcher, compared = Matcher.learn(features, positions, **settings)
        n_frames = len(body.pattern)
        energy = np.square(compared).sum(axis=2, dtype=np.float64).mean()
        weight = float(min(coupling, _RIGID) * energy * (100 / (n_frames - 1)) ** 2)
        frames = np.arange(n_frames)
        own = features.unit(chosen[:, :, columns])
        return cls.to_pattern(
            matcher,
            own[0, :: features.subframes],
            own,
            body.votes,
            body.warp_smoothing,
            Coupling(weight, times[np.newaxis, 1:] - frames) if weight else None,
            columns=columns,
            weight=weight,
            back=np.stack([np.interp(frames, t, frames) for t in times]),
        )

    def positions(self, arrays):
        """Whole performances at all positions, in double precision, not in the unit."""
        arrays = [x.astype(np.float64, copy=False) for x in arrays]
        return normalise(arrays, len(self.pattern), self.matcher.features.subframes)

    def warps(self, positions, body):
        """Distances of the direct paths to the pattern, and times ``tau``, of some performances.

        Parameters
        ----------
        positions : ndarray, shape (n_sequences, Q, n_features)
            Whole performances at all positions, in double precision, not in the unit.
        body : ndarray, shape (n_sequences, P)
            The warps of their bodies.
        """
        own = self.matcher.features.unit(positions[:, :, self.columns])
        return super().warps(own, self._coupling(body))

    def _coupling(self, body):
        """What draws the paths from all bases: from the pattern to the body's warp, and from an
        exemplar to the body's warp from there.
        """
        if not self.weight:
            return None
        at = np.broadcast_to(self.back[:, np.newaxis], (len(self.back), *body.shape))
        from_bases = evaluate_warps(np.broadcast_to(body, at.shape), at)
        return Coupling(self.weight, from_bases - np.arange(body.shape[1]))
