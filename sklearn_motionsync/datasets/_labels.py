"""What recordings and their parts are called in tables."""

# The innermost level of an index.
FRAME = "frame"


def label_of_part(whole, part, level, levels=()):
    """The label of a part of a recording, behind that of the recording, as ``attrs``.

    Parameters
    ----------
    whole : hashable
        What the recording is called; a tuple has several levels.
    part : hashable
    level : str
        What the level of parts is called, unless the recording has one of that name.
    levels : sequence of str, default=()
        Names of the levels of the recording, with that of the frames, if it has any.
    """
    before = whole if isinstance(whole, tuple) else (whole,)
    names = tuple(levels)[:-1]
    if len(names) != len(before):
        several = len(before) > 1
        names = tuple(f"recording_{k}" if several else "recording" for k in range(len(before)))
    last = level if level not in names else f"{level}_{len(names) + 1}"
    return {"performance": (*before, part), "levels": (*names, last, FRAME)}
