"""Names of columns of joint positions: which joints they tell, and in which order."""

from ..gate import names_of

__all__ = ["AXES", "check_columns", "joints_with_axes"]

# Of the positions in the plane, and in space.
AXES = {2: "xy", 3: "xyz"}


def joints_with_axes(df):
    """Names of the joints of a DataFrame of their positions, and how many axes each has.

    Its columns are ``<joint>_x``, ``_y``, ``_z``, ..., or ``<joint>_x``, ``_y``, ... in the plane.
    """
    columns = getattr(df, "columns", None)
    if columns is None or callable(columns):
        raise ValueError(
            "Joints are told from the columns of a DataFrame, got "
            f"{type(df).__name__}. Use pd.DataFrame(positions, columns=skeleton.column_names)."
        )
    columns = [str(column) for column in columns]
    for n_dims, axes in sorted(AXES.items(), reverse=True):
        joints = [column[:-2] for column in columns[::n_dims]]
        if joints and columns == [f"{joint}_{axis}" for joint in joints for axis in axes]:
            return joints, n_dims
    raise ValueError(
        "The columns must be <joint>_x, <joint>_y, <joint>_z or, in the plane, <joint>_x, "
        f"<joint>_y for one joint after the other, got {columns[:4]}"
        f"{' ...' if len(columns) > 4 else ''}; select them with df[skeleton.column_names], with "
        "df.filter(regex='_[xyz]$'), or drop the others."
    )


def check_columns(x, skeleton, what):
    """Refuse a table in which a column of the skeleton stands in another one's place.

    Names that the skeleton does not have are fine.

    Parameters
    ----------
    x : table, or anything without names
    skeleton : Skeleton
    what : str
        What to call it in messages, with a capital letter.
    """
    expected = skeleton.column_names
    place_of = {name: place for place, name in enumerate(expected)}
    for place, name in enumerate(names_of(x) or ()):
        if place_of.get(name, place) != place:
            raise ValueError(
                f"{what}: column {place} is {name!r}, where the skeleton has "
                f"{(*expected, 'none')[min(place, len(expected))]!r}. Bring the columns into the "
                "order of the skeleton's joints by df[skeleton.column_names]."
            )
