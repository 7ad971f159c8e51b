"""Which features are a part of the body, and who performs: what users call by name."""

import numpy as np
import pandas as pd

from ..body.parts import parts_of_names, parts_of_postures
from ..features import choose_features

__all__ = ["choose_parts", "people_of"]

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
