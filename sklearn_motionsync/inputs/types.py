"""Types of arguments that several public signatures share, for mypy, pyright and editors.

They describe what is accepted as far as types can; ``_parameter_constraints`` and
`check_trials` check it when the code runs.
"""

from collections.abc import Hashable, Sequence
from os import PathLike
from typing import Any, Literal, Protocol, TypeAlias, TypeVar

import numpy as np
import pandas as pd

_Item = TypeVar("_Item", covariant=True)


class SupportsArray(Protocol):
    """What NumPy makes an array of: arrays, and tables of pandas, polars and xarray."""

    def __array__(self) -> np.ndarray: ...


class Indexed(Protocol[_Item]):
    """What gives items by index: lists, tuples, and collections that read a file for each."""

    def __len__(self) -> int: ...

    def __getitem__(self, index: int, /) -> _Item: ...


# One number a frame or trial; one trial; numbers of one or two axes. Not text.
ValuesLike: TypeAlias = SupportsArray | Sequence[float]
TrialLike: TypeAlias = SupportsArray | Sequence[Sequence[float]]
NumbersLike: TypeAlias = ValuesLike | Sequence[ValuesLike]
NamesLike: TypeAlias = SupportsArray | Sequence[str]
# A set of trials: a list of 2-D arrays or tables, a 3-D or object array, a table of all.
TrialsLike: TypeAlias = SupportsArray | Indexed[TrialLike] | Sequence[Sequence[float]]
# One label a trial: ``groups``, ``y``, names of subjects.
Labels: TypeAlias = SupportsArray | Indexed[Hashable]
# Some of the features, by index or name.
Features: TypeAlias = int | str | Sequence[int] | Sequence[str] | np.ndarray
# Of pandas or polars.
Table: TypeAlias = pd.DataFrame | SupportsArray
# What ``transform`` returns: an array, a list of arrays where lengths differ, or a table. That
# depends on the input and on ``set_output``, so no type can tell.
Transformed: TypeAlias = Any


# As scikit-learn takes it.
RandomState: TypeAlias = int | np.random.RandomState | None
Path: TypeAlias = str | PathLike[str]

Cost: TypeAlias = Literal["velocity", "elastic", "pose"]
Unit: TypeAlias = Literal["frames", "percent", "seconds"]
UpAxis: TypeAlias = Literal["y", "x", "z", "-y", "-x", "-z"]
