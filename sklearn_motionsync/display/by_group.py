"""Bands of groups of people: a model of each group, on the one clock that all share."""

from typing import NamedTuple

import numpy as np
from sklearn.base import clone

from .given import as_names

__all__ = ["Bands", "Groups", "bands_of_groups"]


class Groups:
    """Which performances are in which group, and who gave them.

    Parameters
    ----------
    groups : sequence of length n_sequences
    people : sequence of length n_sequences, or None
    n_sequences : int

    Attributes
    ----------
    labels : list of str
        The group of every performance.
    names : list of str
        The groups, in the order in which they come.
    people : list of str or None
    """

    def __init__(self, groups, people, n_sequences):
        self.labels = as_names(groups, n_sequences, "groups", "performances")
        self.names = list(dict.fromkeys(self.labels))
        self.people = None
        if people is not None:
            self.people = as_names(people, n_sequences, "people", "performances")

    def members(self, name):
        """The indices of the performances of a group."""
        return np.flatnonzero(np.array(self.labels) == name)

    def people_of(self, name):
        """Who gave the performances of a group, one each; by default as many people."""
        members = self.members(name)
        return members if self.people is None else np.array(self.people)[members]

    def describe(self, name, has_band):
        """A line for the legend: how many performances of how many people, and if none is known."""
        count, people = len(self.members(name)), len(set(self.people_of(name)))
        text = f"{name}: {count} performance{'s' * (count != 1)}"
        if self.people is not None:
            text += f" of {people} {'person' if people == 1 else 'people'}"
        return text if has_band else f"{text}, no band"


class Bands(NamedTuple):
    """Means and bounds of groups, NaN where there is no band.

    Attributes
    ----------
    mean, lower, upper : ndarray, shape (n_groups, P, n_features)
    """

    mean: np.ndarray
    lower: np.ndarray
    upper: np.ndarray


def bands_of_groups(model, performances, groups, band):
    """The mean and the band of every group, by a model of its performances alone.

    A single performance has no band. Neither has a single person, unless the band is that of
    points: nothing tells how others would differ.

    Parameters
    ----------
    model : ActionModel
        Its clones are fitted.
    performances : ndarray, shape (n_sequences, P, n_features)
        Synchronised to one pattern.
    groups : Groups
    band : {"points", "performances", "mean"}

    Returns
    -------
    Bands
    """
    means, bounds = [], []
    for name in groups.names:
        some, people = performances[groups.members(name)], groups.people_of(name)
        means.append(some.mean(axis=0))
        known = len(some) if band == "points" else len(set(people))
        if known < 2:
            bounds.append(np.full((2, *some.shape[1:]), np.nan))
            continue
        own = clone(model).fit(some, groups=None if band == "points" else people)
        if band == "mean":
            # The same picture every time.
            bounds.append(own.mean_envelope(random_state=0))
        else:
            bounds.append(own.envelope(simultaneous=band == "performances"))
    return Bands(np.stack(means), *np.stack(bounds, axis=1))
