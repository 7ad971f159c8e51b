"""compare_groups: whether groups differ in shape or in timing, where, and by how much."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import t as student
from sklearn.base import BaseEstimator
from sklearn.utils import check_random_state

from ..inputs.types import Features, Labels, RandomState, TrialsLike, Unit
from ..matching.counting import first_largest, runs_of
from ..synchronizers.match import UNITS, Match
from ..utils.parallel import Progress
from .curves import AlignedCurves
from .permutations import check_test, families, share_at_most
from .study import Study

# A difference in timing that is left, as a share, whichever signal is left out of the match.
_REMAINS = 0.5

# -- the result ----------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class GroupComparison:
    """What `compare_groups` found.

    Parameters
    ----------
    p_joint : float
        That shape and timing together differ so much by chance.
    p_shape, p_timing : float
        The same of the aligned curves alone, and of the offsets alone.
    p_linear : float
        The same of the curves after linear normalisation, without any warp, for comparison.
    clusters : DataFrame
        Where: one row a stretch of frames with p at most ``level``, the smallest p first.
        ``what``, "shape" or "timing"; ``feature``; ``start``, ``end`` and ``peak``, in the unit;
        ``p``, corrected over all frames, all features, and both of shape and timing;
        ``direction``; ``size``, the mean difference there, in the unit of the signal or of the
        offsets, with the ``lower`` and ``upper`` end of its interval of 95 %, and the ``unit``,
        empty if the signals do not tell.
    n_units : int
        People, or trials without ``people``.
    level : float
        As given.
    design : str
        What was compared, in words; with the ratio of the variances of two groups, if one is twice
        the other, and more than by chance.
    unit : {"frames", "percent", "seconds"}
        Of start, end, peak, and of the sizes of timing.
    smallest_p : float
        That all arrangements of the people allow: 0.125 for four pairs. If it is above ``level``,
        nothing can be found, and ``describe`` says so.
    bands : DataFrame, default=None
        How large each difference is, found or not, at every ``time`` in the unit: ``what``,
        ``feature``, ``difference`` in words ("B less A"), ``size``, and ``lower`` and ``upper``,
        between which the true difference lies with probability ``1 - level`` at all times, in all
        features, of shape and timing together; with less, .8 for .95, where a group of three people
        varies more than the other. ``least`` and ``most`` are the interval of ``1 - 2 level`` at
        this time alone, for `within`.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_motionsync import LinearSynchronizer
    >>> from sklearn_motionsync.comparison import compare_groups
    >>> rng, t = np.random.default_rng(0), np.linspace(0, 1, 50)
    >>> low = [np.sin(3 * t) + rng.normal(0, 0.1) for _ in range(8)]
    >>> high = [x + 0.3 * t for x in low]
    >>> X = np.array(low + high)[:, :, np.newaxis]
    >>> sync = LinearSynchronizer(50).fit(X)
    >>> found = compare_groups(sync, X, ["before"] * 8 + ["after"] * 8)
    >>> found.clusters["direction"].tolist()
    ['after above before']
    """

    p_joint: float
    p_shape: float
    p_timing: float
    p_linear: float
    clusters: pd.DataFrame
    n_units: int
    level: float
    design: str
    unit: Unit
    smallest_p: float
    bands: Any = None

    def __repr__(self):
        return f"GroupComparison({self.describe()!r})"

    def to_frame(self) -> pd.DataFrame:
        """The four p-values as a table.

        Returns
        -------
        DataFrame
            Columns ``p`` and ``differs``, rows joint, shape, timing and linear.
        """
        names = ["joint", "shape", "timing", "linear"]
        p = np.array([self.p_joint, self.p_shape, self.p_timing, self.p_linear])
        index = pd.Index(names, name="test")
        return pd.DataFrame({"p": p, "differs": p <= self.level}, index=index)

    def within(self) -> pd.Series:
        """How small differences are shown to be: a test of equivalence.

        Groups are equivalent, at the level of the comparison, within any margin above this: by two
        one-sided tests at every time, all of which must reject.

        Returns
        -------
        Series
            By what, feature and difference, in the unit of ``size``.
        """
        bounds = self.bands[["least", "most"]].abs().max(axis=1)
        return bounds.groupby([self.bands[name] for name in _OF_BANDS], sort=False).max()

    def describe(self) -> str:
        """The answer in one sentence.

        Returns
        -------
        str
            What was compared, whether it differs, and three p-values.
        """
        aspects = self.clusters["what"].unique().tolist()
        none = "no difference is found"
        if self.p_joint <= self.level:
            none = "they differ, in shape or in timing"
        elif self.smallest_p > self.level:
            none = f"too few to find a difference, as no p can be below {self.smallest_p:.3g}"
        answer = {
            (): none,
            ("shape",): "they differ in shape",
            ("timing",): "they differ in timing",
        }.get(tuple(sorted(aspects)), "they differ in shape and timing")
        values = f"joint p = {self.p_joint:.3f}, shape {self.p_shape:.3f}"
        return f"{self.design}: {answer} ({values}, timing {self.p_timing:.3f})."


# -- the function --------------------------------------------------------------------------


def compare_groups(
    estimator: BaseEstimator | Match,
    X: TrialsLike,
    y: Labels,
    *,
    groups: Labels | None = None,
    covariate: bool = False,
    paired: bool = False,
    signals: TrialsLike | None = None,
    features: Features | None = None,
    level: float = 0.05,
    n_permutations: int = 1999,
    unit: Unit = "percent",
    random_state: RandomState = 0,
    n_jobs: int | None = None,
    verbose: int = 0,
    **params: Any,
) -> GroupComparison:
    """Test whether groups differ in the shape of their curves, in their timing, and where.

    All trials are on the clock of one pattern: aligned curves hold the shape, offsets the timing.
    Both are tested together and apart, by permutations of people.

    Parameters
    ----------
    estimator : synchronizer, Pipeline with one, or Match of X
        Fitted on the trials of all groups together, so that no group has a pattern of its own. A
        `Match` is shared by the test, its figure and its report.
    X : trials
        As the estimator takes them.
    y : sequence of length n_sequences
        What the trials are told apart by: the group of each, such as a condition, of two or more;
        or with ``covariate`` a number for each, such as speed or age.
    groups : sequence of length n_sequences, default=None
        The subject of each trial: the mean of a person's trials of one label is one unit. By
        default every trial is of another person.
    covariate : bool, default=False
        Whether ``y`` are numbers: a regression on the means of people; or on slopes within them, if
        ``y`` differs within people by a tenth of what it differs between them or more.
    paired : bool, default=False
        Whether every person has trials of both of two labels, such as before and after.
    signals : trials, default=None
        What is compared, such as joint angles in degrees: one sequence a trial, at any frame
        rate. By default X in its own units, if the same features reach the synchronizer, scaled or
        not; otherwise what reaches it, such as the dimensions of an `ASpace`.
    features : int, str or list of them, default=None
        Those of the signals that are compared; by default all.
    level : float, default=0.05
        Level of the tests, of all answers together.
    n_permutations : int, default=1999
        Number of random permutations, or of flips of signs if paired.
    unit : {"percent", "frames", "seconds"}, default="percent"
        Of places and offsets. In seconds the pattern lasts as long as the median trial.
    random_state : int, RandomState instance or None, default=0
        Draws the permutations.
    n_jobs : int, default=None
        Jobs that share the permutations, with the same result. None means 1 unless in a
        ``joblib.parallel_config`` context, -1 all cores.
    verbose : int, default=0
        Above 0, print how far the permutations are, at most once a second.
    **params : dict
        What synchronizing X takes besides: ``frame_rate``, frames a second of X, which seconds need
        where tables do not tell; ``keyframes``, which are seconds where a frame rate is given.

    Returns
    -------
    GroupComparison
        Four p-values, and a table of where, what and how much.

    Raises
    ------
    ValueError
        If ``y`` or ``groups`` are not as above; there are too few people, or they have several
        labels without ``paired``; there are gaps; there is no such unit or feature.

    See Also
    --------
    compare_events : Tests when events happen.
    compare_to_norm : Tells of single subjects.

    Notes
    -----
    1. Values at every frame are compared by t, or F of several groups, and become standard normal
       deviates z of the same tail probability. So features and offsets count alike. Groups may vary
       differently: the variance of each has a factor, its ratio to that of all, smoothed over a
       fifth of the clock, by which people are scaled when they are permuted.
    2. Neighbouring frames add up by threshold-free cluster enhancement (Smith and Nichols,
       *NeuroImage* 44, 2009): the sum over heights h below z of ``extent^0.5 h^2``.
    3. In each permutation the largest value over all frames and features gives p of shape, that of
       the offset p of timing, and the smaller of both the joint p (Tippett), for clusters, too.
    4. A cluster of timing is listed if at least half of it is left whichever signal (of more than
       eight, an eighth of them) is left out of the match. ``p_timing`` is of all signals.

    Examples
    --------
    Group B pushes off later, by 5 % of the gait cycle:

    >>> from sklearn_motionsync import DenseSynchronizer
    >>> from sklearn_motionsync.comparison import compare_groups
    >>> from sklearn_motionsync.datasets import make_gait
    >>> gait = make_gait(16, timing=5, random_state=0)
    >>> sync = DenseSynchronizer(n_frames=101).fit(gait.data)
    >>> found = compare_groups(sync, gait.data, gait.group, groups=gait.person, n_permutations=499)
    >>> found.to_frame()["differs"].tolist()  # joint, shape, timing, linear
    [True, False, True, True]
    >>> found.clusters[["what", "direction"]].drop_duplicates().values.tolist()
    [['timing', 'B later than A']]
    """
    check_test(level, n_permutations)
    aligned = AlignedCurves.of(
        estimator,
        X,
        params,
        "compare_groups",
        signals=signals,
        features=features,
        unit=unit,
    )
    study = Study.of(y, groups, covariate=covariate, paired=paired, n=len(aligned.curves))
    return compare_aligned(aligned, study, random_state, level, n_permutations, n_jobs, verbose)


def compare_aligned(
    aligned, study, random_state, level=0.05, n_permutations=1999, n_jobs=None, verbose=0
):
    """The comparison of trials that are matched already: `AlignedCurves`."""
    values = aligned.curves, aligned.offsets[:, :, np.newaxis], aligned.even
    curves, offsets, even = map(study.units, values)
    shape, timing, linear = families(
        study.design,
        [curves, offsets, even],
        n_permutations,
        check_random_state(random_state),
        # Offsets in frames are the same whatever the signals and the unit of time are.
        by=[study.units(aligned.match.offsets[:, :, np.newaxis])],
        n_jobs=n_jobs,
        progress=Progress(type("compare_groups", (), {})(), verbose),
    )
    least = np.minimum(shape.ranks, timing.ranks)
    unit, scales = UNITS[aligned.unit], [study.design.scale_of(x) for x in (curves, offsets)]
    rows = [
        *_clusters(
            "shape", shape, curves, scales[0], aligned.names, aligned.units, study, least, level
        ),
        *_clusters("timing", timing, offsets, scales[1], ["offset"], [unit], study, least, level),
    ]
    rows = [row for row, sure in zip(rows, _confirm(rows, aligned, study), strict=True) if sure]
    table = pd.DataFrame(rows, columns=_COLUMNS).sort_values("p", kind="stable", ignore_index=True)
    for name in ("start", "end", "peak"):
        table[name] = aligned.clock[table[name].to_numpy(dtype=int)]
    z = float(np.quantile(np.maximum(shape.peaks, timing.peaks), 1 - level, method="higher"))
    bands = [
        *_bands("shape", curves, scales[0], aligned, aligned.names, study, z, level),
        *_bands("timing", offsets, scales[1], aligned, ["offset"], study, z, level),
    ]
    return GroupComparison(
        p_joint=max(float(share_at_most(least, least[0])), study.design.floor),
        p_shape=shape.p_value,
        p_timing=timing.p_value,
        p_linear=linear.p_value,
        clusters=table,
        n_units=study.makers.shape[1],
        level=float(level),
        design=study.words + study.spread(curves),
        unit=aligned.unit,
        smallest_p=study.design.smallest_p,
        bands=pd.DataFrame(
            {
                name: np.concatenate([band[name] for band in bands])
                for name in (*_OF_BANDS, "time", "size", "lower", "upper", "least", "most")
            }
        ),
    )


_COLUMNS = ["what", "feature", "start", "end", "peak", "p"]
_COLUMNS += ["direction", "size", "lower", "upper", "unit"]


def _clusters(what, family, values, scale, names, units, study, least, level):
    """Rows of the table: stretches of frames with a corrected p of the level at most."""
    # The share of permutations in which shape or timing has a p as small.
    p = share_at_most(least, family.shares(np.abs(family.observed)))
    p = np.maximum(p, study.design.floor)
    for column in range(p.shape[1]):
        contrast, k = divmod(column, len(names))
        for first, end in runs_of(p[:, column] <= level).tolist():
            stretch = slice(first, end)
            peak = first + first_largest(np.abs(family.observed[stretch, column]))
            size = study.size(values[:, stretch, column].mean(axis=1), what, contrast, scale)
            smallest = p[stretch, column].min()
            yield [what, names[k], first, end - 1, peak, smallest, *size, units[k]]


_OF_BANDS = ["what", "feature", "difference"]


def _bands(what, values, scale, aligned, names, study, z, level):
    """Columns of the table of bands, of each difference of each feature; z is that of all."""
    for column in range(values.shape[2]):
        contrast, k = divmod(column, len(names))
        for change in study.changes[contrast]:
            size, error, freedom = study.change(values[:, :, column], change, scale)
            all_times = study.design.critical(z, freedom) * error
            one_time = student.isf(level, freedom) * error
            texts = what, names[k], change.name
            yield dict(zip(_OF_BANDS, ([text] * len(size) for text in texts), strict=True)) | {
                "time": aligned.clock,
                "size": size,
                "lower": size - all_times,
                "upper": size + all_times,
                "least": size - one_time,
                "most": size + one_time,
            }


def _confirm(rows, aligned, study):
    """Whether each stretch is what it is called: timing must not hinge on one signal."""
    confirmed = np.ones(len(rows), dtype=bool)
    timing = [i for i, row in enumerate(rows) if row[0] == "timing"]
    if not timing:
        return confirmed
    stretches = [slice(rows[i][2], rows[i][3] + 1) for i in timing]

    def effects(offsets):
        units = study.units(offsets[:, :, np.newaxis])
        tested = study.design.rows.T
        return [(tested @ units[:, stretch].mean(axis=1)).ravel() for stretch in stretches]

    whole = effects(aligned.match.offsets)
    for offsets in aligned.offsets_of_others():
        for i, full, reduced in zip(timing, whole, effects(offsets), strict=True):
            confirmed[i] &= reduced @ full >= _REMAINS * (full @ full)
    return confirmed
