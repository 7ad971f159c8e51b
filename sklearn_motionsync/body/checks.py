"""What a skeleton is made of, checked: names, parents, landmarks."""

from collections.abc import Iterable, Mapping, Set
from numbers import Integral, Real

from .landmarks import LANDMARKS

__all__ = ["as_joints", "as_landmarks", "as_parents", "circle_of", "is_whole"]


def as_joints(joints):
    """Names as a tuple of plain text."""
    names = _listed(joints)
    if names is None or not all(isinstance(name, str) and name for name in names):
        raise ValueError(
            "joints must be the names of the joints, a list of text in the order of the columns; "
            f"got {joints!r}."
        )
    return tuple(map(str, names))


def as_parents(parents):
    """Indices as a tuple of plain numbers."""
    listed = _listed(parents)
    if listed is None:
        raise ValueError(
            "parents must be a list, the index of each joint's parent or -1; got "
            f"{type(parents).__name__}."
        )
    for j, parent in enumerate(listed):
        if not is_whole(parent):
            raise ValueError(
                "parents must be whole numbers, the index of each joint's parent or -1; got "
                f"{parent!r} for joint {j}."
            )
    return tuple(map(int, listed))


def _listed(values):
    """What has an order as a tuple; None for text, sets and whatever holds nothing."""
    if isinstance(values, (str, bytes, Set)) or not isinstance(values, Iterable):
        return None
    return None if getattr(values, "ndim", 1) == 0 else tuple(values)


def is_whole(value):
    """Whether it is a whole number of any type, but no truth value."""
    if isinstance(value, bool) or not isinstance(value, Real):
        return False
    return isinstance(value, Integral) or float(value).is_integer()


def as_landmarks(landmarks):
    """Landmarks that are known by name, as a dict."""
    if not isinstance(landmarks, Mapping):
        raise ValueError(
            "landmarks must be a mapping, the joint at each landmark such as "
            f"{{'pelvis': 'root'}}; got {landmarks!r}."
        )
    if unknown := sorted(str(name) for name in landmarks if name not in LANDMARKS):
        raise ValueError(f"landmarks must be among {LANDMARKS}, got {unknown}.")
    return dict(landmarks)


def circle_of(parents):
    """Joints whose parents lead back to the first of them; empty if all lead to a root."""
    sound = set()
    for joint in range(len(parents)):
        chain = []
        while joint >= 0 and joint not in sound:
            if joint in chain:
                return [*chain[chain.index(joint) :], joint]
            chain.append(joint)
            joint = parents[joint]
        sound.update(chain)
    return []
