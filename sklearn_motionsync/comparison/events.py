"""compare_events: when events happen, by group, and whether groups differ in it."""

from __future__ import annotations

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator
from sklearn.utils import check_random_state

from ..inputs.keyframes import Keyframes
from ..inputs.trial_facts import TrialFacts
from ..inputs.types import (
    Labels,
    NumbersLike,
    RandomState,
    Table,
    TrialsLike,
    Unit,
    ValuesLike,
)
from ..inputs.validation import SequenceLevelMixin, check_input
from ..io.events import is_table_of_events, keyframes_from_events
from ..synchronizers.match import check_unit
from ..utils.parallel import Progress
from .permutations import check_test, families
from .study import GroupsOfPeople, Study


def compare_events(
    X: TrialsLike,
    events: Table | NumbersLike | None = None,
    y: Labels | None = None,
    *,
    groups: Labels | None = None,
    covariate: bool = False,
    paired: bool = False,
    unit: Unit = "percent",
    frame_rate: float | ValuesLike | None = None,
    level: float = 0.05,
    n_permutations: int = 1999,
    random_state: RandomState = 0,
) -> pd.DataFrame:
    """When events happen, by group, and whether groups differ in it.

    No trial is warped. An event is at a share of its trial, such as a toe-off at 62 % of the gait
    cycle, or so many seconds after its beginning.

    Parameters
    ----------
    X : trials
        The trials: their labels, lengths, and frame rates count.
    events : DataFrame or array-like, default=None
        One row an event, with the trial, the event, and the time in seconds or frames, as in
        `io.keyframes_from_events`; or what that returns: frames, one row a trial and one column an
        event, NaN where one is not known. By default the events in ``attrs`` of the trials.
    y : sequence of length n_sequences, default=None
        What the trials are told apart by: the label of the group of each; or with ``covariate`` a
        number for each, such as speed or age. Without it there is no test.
    groups : sequence of length n_sequences, default=None
        The subject of each trial. By default every trial is of another person.
    covariate : bool, default=False
        Whether ``y`` are numbers: a regression on the means of people; or on slopes within them, if
        ``y`` differs within people by a tenth of what it differs between them or more.
    paired : bool, default=False
        Whether every person has trials of both of two labels.
    unit : {"percent", "frames", "seconds"}, default="percent"
        Unit of the result: per cent of each trial, its frames, or seconds from its first frame.
    frame_rate : float, or array-like of shape (n_sequences,), default=None
        Frames a second of X, for seconds; by default what tables tell.
    level : float, default=0.05
        Level of the test, of all events together.
    n_permutations : int, default=1999
        Number of random permutations, or of flips of signs if paired.
    random_state : int, RandomState instance or None, default=0
        Draws the permutations.

    Returns
    -------
    DataFrame
        One row an event. For each group ``mean``, ``sd`` and ``n`` of people, behind the name of
        the group if there are several. With ``y`` also ``size``, the mean
        difference, with the ``lower`` and ``upper`` end of its interval of 95 %; its ``direction``;
        ``p``, corrected for the number of events; and ``differs``.

    Raises
    ------
    ValueError
        As from `io.keyframes_from_events` and `compare_groups`; or if an event is known in fewer
        than two people of a group.

    See Also
    --------
    compare_groups : Tests whole curves and their timing.
    io.keyframes_from_events : Reads the table.

    Notes
    -----
    A person counts once, by the mean of the trials that have the event. A person without it does
    not count for this event. p is by permutations of people, as in `compare_groups`, of the largest
    deviate over all events: of groups by Welch's t, as they may vary differently.

    Examples
    --------
    Toe-off is 5 % of the cycle later in group B.

    >>> from sklearn_motionsync.comparison import compare_events
    >>> from sklearn_motionsync.datasets import make_gait
    >>> gait = make_gait(16, timing=5, random_state=0)
    >>> table = compare_events(gait.data, gait.keyframes, gait.group, groups=gait.person)
    >>> table.loc[3, ["A mean", "B mean", "size", "direction"]].tolist()  # the fourth is toe-off
    [...'B later than A']

    A table of events in seconds, without groups:

    >>> import pandas as pd
    >>> from sklearn_motionsync import to_frame, to_trials
    >>> names = pd.Index([*"abcd"], name="trial")
    >>> trials = to_trials(to_frame(gait.data[:4], trials=names))
    >>> events = pd.DataFrame({"trial": names, "event": "toe-off", "seconds": [0.6, 0.6, 0.7, 0.6]})
    >>> compare_events(trials, events, frame_rate=100).round(1)
             mean   sd  n
    event
    toe-off   6...
    """
    check_test(level, n_permutations)
    values, names = _times_of_events(X, events, check_unit(unit), frame_rate)
    n = len(values)
    is_tested = y is not None or covariate or paired
    study = Study.of(y, groups, covariate=covariate, paired=paired, n=n) if is_tested else None
    of_people = GroupsOfPeople.of(None if covariate else y, groups, n)
    table = _table_of_groups(of_people, values, names)
    if study is None:
        return table
    units = study.units(of_people.fill(values)[:, np.newaxis])[:, 0]
    _count_known(units, names, " whose trials are compared")
    rng, progress = check_random_state(random_state), Progress(None, 0)
    curves = [units[:, np.newaxis]]
    (family,) = families(study.design, curves, n_permutations, rng, progress=progress)
    sizes = [study.size(units[:, k], "timing") for k in range(values.shape[1])]
    table[["direction", "size", "lower", "upper"]] = pd.DataFrame(sizes, index=table.index)
    table["p"] = np.maximum(family.shares(np.abs(family.observed[0])), family.floor)
    table["differs"] = table["p"] <= level
    return table


def _times_of_events(X, events, unit, frame_rate):
    """Times of events (n_sequences, n_events) in a unit, NaN where not known, and their names."""
    if events is None or is_table_of_events(events):
        events = keyframes_from_events(X, events, frame_rate=frame_rate)
    reader = type("compare_events", (SequenceLevelMixin, BaseEstimator), {})()
    trials = check_input(reader, X, reset=True, level="sequence", finite="allow-nan")
    facts = TrialFacts.of(X, frame_rate, checked=trials)
    n, last, scale = len(trials), facts.lengths[:, np.newaxis] - 1, 1.0
    frames = Keyframes(events, n, name="events").known(trials) * last
    if unit == "percent":
        scale = 100 / last
    elif unit == "seconds":
        scale = 1 / facts.known_rates()[:, np.newaxis]
    names = events.columns if isinstance(events, pd.DataFrame) else range(frames.shape[1])
    return frames * scale, names


def _count_known(values, names, where):
    """In how many people each event is known: two or more."""
    counts = (~np.isnan(values)).sum(axis=0)
    k = int(counts.argmin())
    if counts[k] < 2:
        raise ValueError(
            f"events: {names[k]!r} is known in {counts[k]} people{where}, and at least 2 are "
            "needed. Leave it out."
        )
    return counts


def _table_of_groups(of_people, values, names):
    """Mean, standard deviation and number of people by event and group."""
    table = pd.DataFrame(index=pd.Index(names, name="event", tupleize_cols=False))
    for label, means in zip(of_people.labels, of_people.means(values), strict=True):
        counts = _count_known(means, names, f" of group {label!r}" if label else "")
        prefix = f"{label} " if label else ""
        table[f"{prefix}mean"] = np.nanmean(means, axis=0)
        table[f"{prefix}sd"] = np.nanstd(means, axis=0, ddof=1)
        table[f"{prefix}n"] = counts
    return table
