"""MVNX: segments and joint angles of Xsens, in XML."""

import re
from xml.etree import ElementTree

from .text import make_unique, read_rate, read_timed_rows

# The element of a frame that holds a group.
_GROUPS = {"segments": "position", "angles": "jointAngle"}
# Abbreviations of a file that may stand for very long text, also of two bytes a character.
_ENTITY = re.compile(rb"<\0?!\0?E\0?N\0?T\0?I\0?T\0?Y")


def read_mvnx(path, *, group="segments"):
    """An MVNX file as a reader of `motion.FORMATS` returns it.

    `group` is "segments", their origins in metres, or "angles" of the joints in degrees.
    """
    if group not in _GROUPS:
        raise ValueError(f"{path}: there are no {group[:40]} in it; group= reads {[*_GROUPS]}.")
    file = _File(path)
    values, decimals = read_timed_rows(file, file.rows(group), time_column=0)
    others = "joint angles" if group == "segments" else "positions of segments"
    poses = "".join(f", the calibration pose {kind!r}" for kind in dict.fromkeys(file.poses))
    facts = {
        "frame_rate": file.frame_rate,
        "units": "m" if group == "segments" else "deg",
        "up": "z",
        "kind": group,
        "left_out": f"orientations, {others}{poses}",
    }
    if file.has_times:
        # They are in milliseconds.
        facts |= {"times": values[:, 0] / 1000, "decimals": decimals + 3}
    values = values[:, 1:].copy()
    if group == "angles":
        channels = [f"{joint}_{axis}" for joint in file.joints for axis in "xyz"]
        subjects = [file.subject] * len(channels)
        return facts | {"channels": channels, "values": values, "subjects": subjects}
    facts |= {"joints": file.segments, "subjects": [file.subject] * len(file.segments)}
    positions = values.reshape(len(values), -1, 3)
    return facts | {"parents": file.parents, "positions": positions}


class _File:
    """What stands above the frames, and the frames one by one, each of which is then freed."""

    def __init__(self, path):
        self.path, self.frame_rate, self.subject, self.has_times = path, None, None, True
        self.segments, self.joints, self.parents, self.poses, self._n = [], [], [], [], 0

    def error(self, message):
        return ValueError(f"{self.path}, frame {self._n}: {message}")

    def rows(self, group):
        """Yield the time of each frame, as text in milliseconds, and the numbers of a group."""
        frames = None
        for event, element in self._elements():
            name = _name_of(element)
            if event == "start" and name == "subject":
                if self.subject is not None:
                    raise self.error("a second subject begins; export a file for each.")
                self.subject = element.get("label", "")
                self.frame_rate = read_rate(element.get("frameRate", ""))
            elif event == "start" and name == "frames":
                frames = element
            elif event == "end" and name == "segments":
                self.segments, self.parents = _labels_of(element), [-1] * len(element)
            elif event == "end" and name == "joints":
                self.joints, self.parents = _labels_of(element), _parents_of(self.segments, element)
            elif event == "end" and name == "frame" and frames is not None:
                if (kind := element.get("type", "normal")) == "normal":
                    yield self._row(element, group)
                    self._n += 1
                elif len(self.poses) < 9:
                    self.poses.append(kind[:40])
                frames.clear()

    def _elements(self):
        """Starts and ends of all elements."""
        with self.path.open("rb") as file:
            try:
                end = b""
                while portion := file.read(2**16):
                    if _ENTITY.search(end + portion):
                        raise ValueError("it declares entities, which no recording needs")
                    end = portion[-16:]
                file.seek(0)
                yield from ElementTree.iterparse(file, ("start", "end"))
            except (ElementTree.ParseError, LookupError, ValueError) as error:
                raise self.error(f"{error}; the file is damaged or not complete.") from error

    def _row(self, element, group):
        n = len(self.segments if group == "segments" else self.joints)
        texts = [child.text or "" for child in element if _name_of(child) == _GROUPS[group]]
        fields = " ".join(texts).encode().split()
        if not n or len(fields) != 3 * n:
            raise self.error(
                f"<{_GROUPS[group]}> needs 3 numbers for each of {n} {group}, got {len(fields)}. "
                f"Export the file with its {group}."
            )
        self.has_times &= (time := element.get("time")) is not None
        return [(time or "0").encode(), *fields]


def _name_of(element):
    """The name of an element without its namespace."""
    return element.tag.rpartition("}")[2]


def _labels_of(element):
    named = enumerate(element, 1)
    return make_unique([x.get("label") or f"{_name_of(x)}_{i}" for i, x in named])


def _parents_of(segments, joints):
    """The parent of each segment, which stands before it; -1 without one."""
    parents, places = [-1] * len(segments), {name: i for i, name in enumerate(segments)}
    for joint in joints:
        # Such as Pelvis/jLeftHip and LeftUpperLeg/jLeftHip.
        ends = [(end.text or "").partition("/")[0].strip() for end in joint]
        parent, child = (places.get(end, -1) for end in (*ends, "", "")[:2])
        if parent < child:
            parents[child] = parent
    return parents
