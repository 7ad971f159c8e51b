"""Columns of positions: the joint, axis or quality that each is, as programs spell them."""

import re
from collections import Counter, defaultdict
from typing import NamedTuple

import numpy as np

# Names of columns that tell how sure a position is, the best ones first.
CONFIDENCE = [
    *("likelihood", "confidence", "conf", "score", "visibility", "visible", "vis", "probability"),
    *("prob", "certainty", "quality", "tracking[ _]?state", "state", "presence", "[vcps]"),
]
# The axes, w of a quaternion, the confidence, and errors, of which larger ones are worse.
_TAIL = rf"(?P<tail>[xyzw]|{'|'.join(CONFIDENCE)}|error|residual|inferred|n_?cams)"
_BETWEEN = r"[\s_.:;/|-]"
_UNIT = r"(?:[\s_]*[\s_\[(](?P<unit>mm|cm|m|px|pixels?)[\])]?)?"
# LASI_x, LASI X, LASI:X, LASI[x], LASI.x (mm); x_LASI, X LASI; LASIX, noseX; x0.
_SPELLINGS = [
    re.compile(rf"(?P<joint>.+?)(?:{_BETWEEN}[\[(]?|[\[(]){_TAIL}[\])]?{_UNIT}", re.IGNORECASE),
    re.compile(rf"{_TAIL}{_BETWEEN}(?P<joint>.+?){_UNIT}", re.IGNORECASE),
    re.compile(rf"(?P<joint>.+?)(?-i:(?=[A-Z])){_TAIL}", re.IGNORECASE),
    re.compile(rf"{_TAIL}(?P<joint>(?-i:[A-Z0-9]).*)", re.IGNORECASE),
]
# Where a word begins in another: "AccelX".
_HUMP = re.compile(r"(?<=[a-z0-9])(?=[A-Z])")
# Names of vectors that are no positions, and words for those that are.
_NO_POSITION = re.compile(
    r"(.*[^a-z])?(acc|accel|acceleration|vel|velocity|speed|gyro|mag|rot|rotation|orient|"
    r"orientation|quat|quaternion|angle|angles|force|moment|torque|power|grf|euler)[\s_.]?\d*"
)
_POSITION = re.compile(rf"{_BETWEEN}(pos|position|coords?|real|world|global)$", re.IGNORECASE)
_FRAME = re.compile(
    r"|#|unnamed: 0|index|fnum|(video|image)?[\s_]?frames?[\s_]*(#|no\.?|idx|index|num|number|id)?",
    re.IGNORECASE,
)
_TIME = re.compile(
    r"(?:t|time|time[\s_]?stamps?|seconds|milliseconds)[\s_]*[\[(]?(?P<unit>s|sec|seconds|ms|msec|"
    r"milliseconds|us|ns)?[\])]?",
    re.IGNORECASE,
)
_SECONDS = {"ms": 1e-3, "msec": 1e-3, "milliseconds": 1e-3, "us": 1e-6, "ns": 1e-9}


class JointColumns(NamedTuple):
    """The columns of a table of positions.

    Attributes
    ----------
    joints : list of str
        In the order of their first columns; a name stands there as often as its columns do.
    axes : str
        "xy" or "xyz"; "" without any joint.
    places : ndarray of int, shape (n_joints, n_axes)
        The column of each axis of each joint.
    confidence : list of int
        The column that tells how sure each joint is, -1 where there is none.
    rest : list of int
        All columns but those of positions, and of their confidence, errors and the like.
    subjects : list of str
        The subject of each joint, where labels are tuples that name several; else "".
    units : str or None
        The unit that the labels of the positions name, such as "mm".
    """

    joints: list
    axes: str
    places: np.ndarray
    confidence: list
    rest: list
    subjects: list
    units: str | None


def parse_columns(labels, any_vector=False):
    """The joints, axes and qualities of columns, as `JointColumns`.

    Labels are texts such as "LASI_x", "LASI X", "LASI:X" or "x_LASI", all in one of these
    spellings; or tuples of a `MultiIndex`, such as (network, joint, axis) or (network, subject,
    joint, axis). Joints that lack an axis that others have are left to the rest, as are vectors
    whose names say that they are no positions, unless any vector counts.
    """
    labels = list(labels)
    if any(isinstance(label, tuple) for label in labels):
        return _best([_split_tuples(labels)], any_vector)
    texts = [str(label).strip() for label in labels]
    spellings = [[_split(text, spelling) for text in texts] for spelling in _SPELLINGS]
    return _best(spellings, any_vector)


def find_clock(labels):
    """The places of the columns of frames and of times (None if there is none), and its seconds.

    The last is how many seconds the unit of the times is, None where the label names none.
    """
    texts = [str(label[0] if isinstance(label, tuple) else label).strip() for label in labels]
    frame = next((i for i, text in enumerate(texts) if _FRAME.fullmatch(text)), None)
    for i, text in enumerate(texts):
        if match := _TIME.fullmatch(text):
            unit = match["unit"] or (text if text.lower().endswith("seconds") else None)
            return frame, i, None if unit is None else _SECONDS.get(unit.lower(), 1.0)
    return frame, None, None


def _split(text, spelling):
    """Subject and joint, axis or quality, and unit of a label; None if it has none."""
    parts = spelling.fullmatch(text)
    joint = parts and parts["joint"].strip(" _.:;/|-")
    if not joint:
        return None
    return ("", joint), parts["tail"].lower(), (parts.groupdict().get("unit") or "").lower()


def _split_tuples(labels):
    """The same of tuples; levels before the joint that are equal in all of them do not count."""
    parts = [label if isinstance(label, tuple) else (label,) for label in labels]
    n_levels = max(map(len, parts))
    whole = [
        n_levels > 1 and len(x) == n_levels and re.fullmatch(_TAIL, str(x[-1]).strip().lower())
        for x in parts
    ]
    above = [x[:-2] for x, is_whole in zip(parts, whole, strict=True) if is_whole]
    differing = [i for i in range(n_levels - 2) if len({levels[i] for levels in above}) > 1]
    return [
        ((":".join(str(x[level]) for level in differing), str(x[-2]).strip()), tail[0], "")
        if tail
        else None
        for x, tail in zip(parts, whole, strict=True)
    ]


def _gather(splits, any_vector):
    """The axes, and the columns of each joint that has them all, by axis or quality."""
    seen, columns = Counter(), defaultdict(dict)
    for place, split in enumerate(splits):
        if split is not None:
            joint, tail, _ = split
            columns[*joint, seen[joint, tail]][tail] = place
            seen[joint, tail] += 1
    columns = {
        joint: tails
        for joint, tails in columns.items()
        if tails.keys() >= {"x", "y"}
        and "w" not in tails
        and (any_vector or not _NO_POSITION.fullmatch(re.sub(_HUMP, "_", joint[1]).lower()))
    }
    n_in_space = sum("z" in tails for tails in columns.values())
    axes = ("xyz" if 2 * n_in_space >= len(columns) else "xy") if columns else ""
    return axes, {joint: t for joint, t in columns.items() if t.keys() >= set(axes)}


def _best(spellings, any_vector):
    """The columns by that one of several spellings which gives the most joints."""
    axes, columns, splits = max(
        ((*_gather(splits, any_vector), splits) for splits in spellings),
        key=lambda each: len(each[1]),
    )
    joints = [joint for _, joint, _ in columns]
    if all(map(_POSITION.search, joints)):
        joints = [_POSITION.sub("", joint) for joint in joints]
    places = np.array([[t[axis] for axis in axes] for t in columns.values()], dtype=np.int64)
    qualities = [{k: t[k] for k in t if k not in "xyz"} for t in columns.values()]
    quality = [place for t in qualities for place in t.values()]
    units = {splits[place][2] for place in places.flat}
    return JointColumns(
        joints,
        axes,
        places,
        [min(map(_rank, t.items()), default=(0, -1))[1] for t in qualities],
        sorted(set(range(len(splits))).difference(places.flat, quality)),
        [subject for subject, *_ in columns],
        units.pop() or None if len(units) == 1 else None,
    )


def _rank(quality):
    """How well a quality tells the confidence, the best first, and its column; errors do not."""
    name, place = quality
    ranks = (i for i, each in enumerate(CONFIDENCE) if re.fullmatch(each, name))
    rank = next(ranks, len(CONFIDENCE))
    return rank, place if rank < len(CONFIDENCE) else -1
