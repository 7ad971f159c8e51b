"""Wide tables: one row a performance, frames side by side in columns. Told, not read."""

import re
from collections import Counter

__all__ = ["call_to_unfold", "numbered_columns"]

# What tells rows apart that no column does.
_KEY = "performance"


def numbered_columns(columns):
    """Which columns are numbered, such as ``knee_1``, ``knee_2``, ...

    Returns
    -------
    numbers : dict of (str, str) to int
        How many there are of each name and what is between name and number; two at least.
    others : list
        All other columns.
    """
    parts = {name: re.fullmatch(r"(.*?)([_\-. ]?)\d+", str(name)) for name in columns}
    counts = Counter(part.groups() for part in parts.values() if part)
    numbers = {key: count for key, count in counts.items() if count > 1}
    return numbers, [
        name for name in columns if not parts[name] or parts[name].groups() not in numbers
    ]


def call_to_unfold(columns, levels=()):
    """The call that makes a long table of one whose frames lie side by side in columns.

    Parameters
    ----------
    columns : Index
    levels : list of str
        Levels of the index that name the performance, beside columns that are not numbered.

    Returns
    -------
    str or None
        None if no columns are numbered, or not alike.
    """
    numbers, others = numbered_columns(columns)
    names, between = [name for name, _ in numbers], {sep for _, sep in numbers}
    if len(between) != 1 or ("" in names and len(names) > 1):
        return None
    keys, table = [*levels, *others], "df.reset_index()" if levels else "df"
    if not keys:
        keys, table = [_KEY], f"df.reset_index(names={_KEY!r})"
    if names == [""]:
        long = f"{table}.melt({keys}, var_name='frame', value_name='x').astype({{'frame': float}})"
        return f"to_sequences({long}.dropna(), by={keys}, time='frame')"
    long = f"pd.wide_to_long({table}, {names}, i={keys}, j='frame', sep={between.pop()!r})"
    return f"to_sequences({long}.dropna(), time='frame')"
