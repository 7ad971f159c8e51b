"""What is known of trials beside their numbers: frame rate, unit and vertical axis.

Tables say so: their ``attrs``, as `io.read_motion` fills them, and an index in seconds. Arrays say
nothing, and are taken as they are.
"""

import warnings

import pandas as pd

from .recorded import SAME_RATE, frame_rate_of_rows
from .wording import within

# Attribute of estimators: the different values of each fact in the training set.
_FACTS = "_facts_in"
# The facts that matter where the times of frames are given.
TIMELESS = "units", "up"
# Units that are spelled in several ways, without a plural's s.
_UNITS = {"millimeter": "mm", "millimetre": "mm", "centimeter": "cm", "centimetre": "cm"}
_UNITS |= {"meter": "m", "metre": "m", "degree": "deg", "°": "deg", "radian": "rad"}
# Of each fact: how a value reads, and what to do where values differ.
_WORDS = {
    "frame_rate": (
        "{:g} frames a second",
        "Durations and speeds are compared in frames. Resample: to_trials(x, frame_rate={:g}).",
    ),
    "units": ("the unit {!r:.60}", "Convert the numbers, and set x.attrs['units'] = {!r:.60}."),
    "up": ("the vertical axis {!r}", "Turn the positions, and set x.attrs['up'] = {!r}."),
}


def facts_of(x):
    """The known facts of a trial: a dict, which is empty for an array."""
    if not isinstance(x, pd.DataFrame):
        return {}
    up = x.attrs.get("up")
    facts = {
        "frame_rate": frame_rate_of_rows(x),
        "units": _unit(x),
        "up": up if isinstance(up, str) else None,
    }
    return {fact: value for fact, value in facts.items() if value is not None}


def facts_in_fit(estimator):
    """The facts of the training set of an estimator: a dict of tuples of different values."""
    return vars(estimator).get(_FACTS, {})


def check_facts(estimator, facts, called, *, reset, which=None):
    """Hold the facts of trials against each other, and against those of the training set.

    ``reset`` is True in ``fit``, where the estimator gets the facts of its training set. A
    parameter ``frame_rate`` of it counts as known. The facts of ``which`` matter; by default those
    of its ``_facts``, or all. All else is as for `compare_facts`.
    """
    which = getattr(estimator, "_facts", None) if which is None else which
    known = {} if reset else facts_in_fit(estimator)
    reference = {fact: (values, "the training set has") for fact, values in known.items()}
    if (rate := getattr(estimator, "frame_rate", None)) is not None:
        reference["frame_rate"] = (rate,), "frame_rate is"
    values = compare_facts(facts, called, which, reference)
    if reset:
        vars(estimator)[_FACTS] = values


def compare_facts(facts, called, which=None, reference=None):
    """The different values of the facts of trials, which must agree but for the frame rate.

    Parameters
    ----------
    facts : list of dict
        Of each trial, from `facts_of`.
    called : callable
        Gives the name of a trial by its index.
    which : sequence of str, default=None
        The facts to compare; by default all.
    reference : dict of str to (tuple, str), default=None
        Values known before, and where they are from, for messages; by default the first trial that
        says something is the reference of others.

    Returns
    -------
    dict of str to tuple
        Only those that are known.

    Raises
    ------
    ValueError
        If units or vertical axes differ.

    Warns
    -----
    UserWarning
        If frame rates differ by more than 1 %.
    """
    reference = {} if reference is None else reference
    compared = {fact: values for fact, (values, _) in reference.items()}
    for fact in (_WORDS if which is None else which) if any(facts) else ():
        values, source = reference.get(fact, ((), ""))
        values, different = list(values), {}
        for i, value in enumerate([each.get(fact) for each in facts]):
            if value is None or any(_equal(value, other) for other in values):
                continue
            if values:
                different[i] = value
            else:
                values, source = [value], f"{within(called(i))} has"
        if values:
            compared[fact] = tuple(dict.fromkeys([*values, *different.values()]))
        if different:
            _report(fact, different, called, source, values[0])
    return compared


def _report(fact, different, called, source, reference):
    """Say that trials differ: a warning of rates, an error of all else."""
    words, remedy = _WORDS[fact]
    first, n_more = next(iter(different)), len(different) - 1
    more = f" {n_more} more differ." if n_more else ""
    message = (
        f"{called(first)} has {words.format(different[first])}, and {source} "
        f"{words.format(reference)}.{more} {remedy.format(reference)}"
    )
    if fact != "frame_rate":
        raise ValueError(message)
    warnings.warn(message, UserWarning, stacklevel=2)


def _equal(a, b):
    return a == b if isinstance(a, str) or isinstance(b, str) else abs(a - b) <= SAME_RATE * b


def units_of_columns(x):
    """The known units of the columns of a trial: a dict by their names."""
    if not isinstance(x, pd.DataFrame):
        return {}
    units, names = _spelled_units(x), x.attrs.get("channels")
    if len(units) == 1:
        units = units * len(x.columns)
    # pandas leaves attrs as they are where columns are selected or rearranged.
    names = names if isinstance(names, (list, tuple)) and len(names) == len(units) else x.columns
    unit_by_name = dict(zip(names, units, strict=True)) if len(names) == len(units) else {}
    return {name: unit_by_name[name] for name in x.columns if unit_by_name.get(name)}


def _unit(x):
    """The unit of a table as one text, or those of its columns by their names; None without any."""
    units = _spelled_units(x)
    if len(set(units)) > 1 and (unit_by_name := units_of_columns(x)):
        units = [unit_by_name.get(name, "") for name in sorted(x.columns, key=str)]
    return " ".join(units[:1] if len(set(units)) == 1 else units) or None


def _spelled_units(x):
    """The units that a table states, each spelled in one way."""
    units = x.attrs.get("units")
    units = units if isinstance(units, (list, tuple)) else [units]
    units = [unit.strip() if isinstance(unit, str) else "" for unit in units]
    singular = [unit.lower().removesuffix("s") for unit in units]
    short = set(_UNITS.values())
    return [
        one if one in short else _UNITS.get(one, unit)
        for one, unit in zip(singular, units, strict=True)
    ]
