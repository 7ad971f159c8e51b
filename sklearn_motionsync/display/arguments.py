"""Arguments that several displays take: names, units, indices, frames, and trials."""

from collections.abc import Iterable, Mapping, Set
from itertools import takewhile
from numbers import Real

import numpy as np
import pandas as pd

from ..body.columns import plain_positions
from ..body.skeleton import Skeleton
from ..inputs.collections import as_collection
from ..inputs.facts import units_of_columns
from ..inputs.numbers import is_integer
from ..inputs.tables import labels_of
from ..utils.pipelines import flat_steps
from .base import text_of_label

# Characters of a label and its unit that are too long for one line.
_LONG = 18
# The largest number of panels.
_MAX_PANELS = 1000


def as_names(names, count, what, each):
    """Names as a list of text, one for each of ``count`` things.

    Parameters
    ----------
    names : sequence
        Values of any type but NaN and None.
    count : int
    what, each : str
        The name of the argument, and what its entries belong to.
    """
    listed = _as_list(names)
    if (
        listed is None
        or len(listed) != count
        or any(np.ndim(name) > 0 or pd.isna(name) for name in listed)
    ):
        got = repr(names) if listed is None else f"{len(listed)}: {listed[:6]}"
        raise ValueError(
            f"{what} must be a list of text, one for each of the {count} {each}, got {got}."
        )
    return [str(name) for name in listed]


def as_indices(indices, count, what):
    """One index or several from 0 to ``count - 1``, as a list."""
    listed = [indices] if isinstance(indices, Real) else _as_list(indices)
    if not listed or not all(is_integer(i) and 0 <= i < count for i in listed):
        raise ValueError(
            f"{what} must be from 0 to {count - 1}, got "
            f"{indices if listed is None else listed!r}: give whole numbers."
        )
    return [int(i) for i in listed]


def as_index(index, count, what):
    """One index from 0 to ``count - 1``."""
    if not isinstance(index, Real):
        raise ValueError(f"{what} must be one number from 0 to {count - 1}, got {index!r}.")
    return as_indices(index, count, what)[0]


def as_frames(frames, n_frames):
    """Frames by index, or a number of evenly spaced frames from the first to the last."""
    if not isinstance(frames, Real):
        return as_indices(frames, n_frames, "frames")
    if not (is_integer(frames) and 1 <= frames <= _MAX_PANELS):
        raise ValueError(
            f"frames must be how many, a whole number from 1 to {_MAX_PANELS}, or a list of frames "
            f"from 0 to {n_frames - 1}; got {frames!r}."
        )
    return np.linspace(0, n_frames - 1, int(frames)).round().astype(int).tolist()


def as_trials(X, skeleton=None) -> list:
    """The trials of a collection, or a single one as a list; of positions with the skeleton."""
    X = plain_positions(X, skeleton) if isinstance(skeleton, Skeleton) else X
    collection = as_collection(X)
    if collection is not None and len(collection) == 0:
        raise ValueError("Found 0 trials (n_samples=0); there is nothing to draw.")
    return [X] if collection is None else collection


def names_of_trials(names, trials):
    """Names of trials as text; None: their labels, the levels of a label joined by commas."""
    if names is None:
        names = map(text_of_label, labels_of(trials)[0])
    return as_names(names, len(trials), "names", "trials")


def labels_of_signals(names, known_units, units=None):
    """Labels of signals with their units, which are below if both are long.

    Parameters
    ----------
    names : list of str
    known_units : dict of str to str
        The units of these and other signals; empty where one is not known.
    units : str, list of str, dict of str to str, or None
        In place of the known units: of all signals, one each, or by name.
    """
    known_units, out = dict.fromkeys(names, "") | known_units, []
    if isinstance(units, str):
        units = dict.fromkeys(names, units)
    elif units is not None and not isinstance(units, Mapping):
        units = dict(zip(names, as_names(units, len(names), "units", "signals"), strict=True))
    for name in units or ():
        if name not in known_units:
            signals = ", ".join(map(str, known_units))
            raise ValueError(f"units: there is no signal {name!r}; there are {signals}.")
    known_units |= units or {}
    for name in names:
        unit = str(known_units[name])
        space = " " if len(name) + len(unit) < _LONG else "\n"
        out.append(f"{name}{space}({unit})" if unit else name)
    return out


def times_from_zero(times, n_frames, frame_rate):
    """Times of a live take since the first frame; by the frame rate, or frames, without stamps."""
    if times is None:
        return np.arange(n_frames) / (frame_rate or 1.0)
    times = np.asarray(times, dtype=np.float64)
    return times - times[0]


def time_label(frame_rate):
    """The label of the time axis of a live take."""
    return "time (frames)" if frame_rate is None else "time (s)"


def undo_scaling(before, X, width):
    """What takes features back before the scalers of a pipeline, and the units they then have.

    Parameters
    ----------
    before : Pipeline or None
        The steps before an estimator. Synchronizers among them change no features.
    X : trials, as the pipeline takes them
    width : int
        The number of features that reach the estimator.

    Returns
    -------
    undo : callable
        Of arrays (n_frames, width), also with features beside those that were scaled.
    units : dict of str to str
        By the names of columns of X; empty where other steps than scalers have made the features.
    """
    steps = [] if before is None else flat_steps(before)
    steps = [step for step in reversed(steps) if not hasattr(step, "match")]
    scalers = list(takewhile(lambda step: _keeps_features(step, width), steps))

    def undo(x):
        for step in scalers:
            n_scaled = step.n_features_in_
            x = np.column_stack([step.inverse_transform(x[:, :n_scaled]), x[:, n_scaled:]])
        return x

    collection = None if len(scalers) < len(steps) else as_collection(X)
    return undo, {} if collection is None else units_of_columns(collection[0])


def _keeps_features(step, width):
    """Whether a step can be inverted, and its features are those before it, as of scalers."""
    count = getattr(step, "n_features_in_", width + 1)
    if count > width or not hasattr(step, "inverse_transform"):
        return False
    names = getattr(step, "feature_names_in_", [f"x{i}" for i in range(count)])
    return list(step.get_feature_names_out()) == list(names)


def _as_list(values):
    """A list of ordered values; None for text, sets, mappings and scalars."""
    if isinstance(values, (str, bytes, Set, Mapping)) or not isinstance(values, Iterable):
        return None
    return None if getattr(values, "ndim", 1) != 1 else list(values)
