"""Landmarks guessed from the names of joints: those of a known format, or by parts of names."""

import functools
import os
import re
import warnings
from collections import defaultdict

from .formats import FORMATS, LANDMARKS, SIDES
from .limbs import limbs_between

# Names of the joint at each landmark, without the side and in small letters, the likeliest first.
# A new marker set needs a word here:
#   a|b   the first one that is there;
#   a+b   the mean of two;
#   ~a|b  the mean of the outer and the inner marker of a joint that is called a or b, such as
#         "KneeLat" and "KneeMed" or "LFC" and "MFC"; otherwise the outer one, or the plain name;
#   a*    a bone, which is at its near end in skeletons; markers of that name are on its middle.
_JOINTS = {
    "pelvis": "pelvis|hips|hip|hipcenter|midhip|spinebase|root|pelo|waist",
    "neck": "neck|neck1|neck01|necktwist01|shouldercenter|spineshoulder|thorax|trxo",
    "head": "head|nose|headtop|headtopend|hedo|tophead|vertex",
    "shoulder": """sjc|shoulderjc|clo upperarm|uparm|uarm|arm* shoulder|shouldertop|sho|should
        acromion|acromium|acro|acr|sae|acj|ac|aa|headhum""",
    "elbow": """ejc|elbowjc|huo hle+hme el+em ~elbow|elb|el|ee|cou|humerusepicondyle
        forearm|lowerarm|lowarm|farm|larm*""",
    "wrist": """wjc|wristjc|rao wra+wrb rsp+usp rs+us lw+mw faradius+faulna ~wrist|wri|wr|styloid wr
        hand*""",
    "hip": """hjc|hipjc|fep|hipjointcenter|hipjointcentre|hipcenter|hipcentre thigh|upleg|upperleg*
        hip|hipjoint asis|asi|ias|eas|eias|fwt|waistfront gtr|gtro|gt|ftc|troch|trochanter""",
    "knee": """kjc|kneejc|feo fle+fme le+me cl+cm ~knee|kne|kn|ek|fe|fc|femepi|fle|knjntln
        calf|leg|lowerleg|lowleg|shin|shank*""",
    "ankle": "ajc|anklejc|tio fal+tam ank+med ~ankle|ank|mal|mall|malleolus|m|fal foot*",
    "heel": "heel|hee|heelback|calcaneus|calcn|calca|calc|cal|ca|fcc",
    "toe": """bigtoe|toetip|toe|toes|footindex|toebase|ball|mt2|forefoot2|fm2|mt1|mt5|hal|hlx|smh
        ~toe foot""",
}  # fmt: skip
_OUTER = ["lateral", "lat", "l", "outer", "out", "ext", "radial", "rad", "radius"]
_INNER = ["medial", "med", "m", "inner", "int", "in", "mid", "ulnar", "uln", "ulna"]
# Epicondyles of an arm or a leg: of the one whose joint has no other name.
_EPICONDYLES = "~epicondyle|epi|epic"
# Front and back of the pelvis, and markers of both sides whose mean is the head.
_FRONT, _BACK = "asis|asi|ias|eas|eias|fwt|waistfront", "psis|psi|ips|eps|bwt|waistback"
_SACRUM = "sacrum|sacral|vsacral|sacr|vsac|sac|s2|waistback"
_SIDES_OF_HEAD = "ear|fhd|temple|head|tet"
# Names of markers that no skeleton of bones has.
_SKIN = (
    f"{_FRONT}|acromion|acromium|acr|sae|sho|elb|kne|ank|hee|fle|lfc|lm|lmal|mknee|kneemed|kneein"
)
# Names of several markers on a segment, with their numbers, where no joint has a marker.
_CLUSTERS = {
    "pelvis": "pelvis|pelv|pv|waist",
    "shoulder": "upperarm|uparm|uarm|ua|arm|ar",
    "elbow": "forearm|lowerarm|farm|fa",
    "wrist": "hand|glove",
    "hip": "thigh|th|femur",
    "knee": "shank|shin|sk|sh|tibia|tib|tb",
    "ankle": "foot|ft",
}
# Formats with all landmarks at joints of their own. The names of the others are in the table.
_KNOWN = [
    known.landmarks
    for known in FORMATS.values()
    if len(known.landmarks) == len(LANDMARKS)
    and all(isinstance(at, str) for at in known.landmarks.values())
]
# The landmarks in the middle of a pair.
MIDPOINTS = {"pelvis": "hip", "neck": "shoulder"}


def guess_landmarks(joints, names=(), *, clusters=True):
    """The landmarks of a known format if the names are its, otherwise guessed by parts of names.

    `names` may list joints of the file that have no columns; their landmarks are left out. Where
    no joint is named, `clusters` of markers on segments stand for landmarks, with a warning.
    """
    all_names = {*joints, *names}
    listed = [*joints, *(name for name in names if name not in set(joints))]
    plain = {_plain(name): joint for name, joint in reversed(_without_prefix(listed))}
    for landmarks in _KNOWN:
        if not set(landmarks.values()) <= all_names:
            landmarks = {name: plain.get(_plain(joint)) for name, joint in landmarks.items()}
        if None not in landmarks.values():
            return {name: joint for name, joint in landmarks.items() if joint in set(joints)}
    by_subject = defaultdict(list)
    for name, joint in _without_prefix(list(joints)):
        by_subject[name.rpartition(":")[0]].append(joint)
    parts = [_Parts(of_one) for of_one in by_subject.values()]
    guesses = sorted((_guess_by_parts(of_one) for of_one in parts), key=len)
    # A person is taken before objects with names of their own, but none of two people.
    guess = guesses[-1] if len(guesses) == 1 or len(guesses[-1]) > 2 * len(guesses[-2]) else {}
    if clusters and len(parts) == 1 and not limbs_between(add_midpoints(guess)):
        middles = parts[0].find_clusters()
        if limbs_between(add_midpoints(middles)):
            warnings.warn(
                f"The names tell several markers on each segment, but none at a joint: the middles "
                f"of {middles} stand for these landmarks, so limbs join the middles of segments. "
                "Give landmarks={...} if some of the markers are at joints.",
                UserWarning,
                stacklevel=3,
            )
            return guess | middles
    return guess


def guess_feet(joints, landmarks):
    """The joints at heels and toes, ``left_heel`` and so on, as far as names tell."""
    held = {joint for at in landmarks.values() for joint in as_tuple(at)}
    parts = _Parts(joints, held)
    return parts.find_pair("heel") | parts.find_pair("toe")


def add_midpoints(landmarks):
    """Landmarks with a missing pelvis and neck as the means of the hips and the shoulders."""
    for name, part in MIDPOINTS.items():
        pair = [landmarks.get(f"{side}_{part}") for side in SIDES]
        if name not in landmarks and None not in pair:
            landmarks = landmarks | {name: tuple(j for at in pair for j in as_tuple(at))}
    return landmarks


def missing_counterparts(landmarks, named):
    """Landmarks that are missing while the other side was guessed, unless they were given."""
    return [
        name
        for name in LANDMARKS
        if name not in {*landmarks, *named}
        and (other := other_side(name)) in landmarks
        and other not in named
    ]


def other_side(landmark):
    """The landmark of the other side; None for pelvis, neck and head."""
    side, _, part = landmark.rpartition("_")
    return f"{SIDES[side == SIDES[0]]}_{part}" if side else None


def as_tuple(at):
    """The joints of a landmark, one or several, as a tuple."""
    return (at,) if isinstance(at, str) else tuple(at)


# -- names, and the sides and parts in them -----------------------------------------------------

_SIDE_OF = {"left": "left", "right": "right", "l": "left", "r": "right"}
# Words that say how a marker was named or computed, not where it is.
_NO_PART = {"study", "marker", "v"}


class _Parts:
    """Joints by the sides and the other parts of their names, but for those that are left out."""

    def __init__(self, joints, without=()):
        # Of equal names those with a word for computed markers come first.
        pairs = sorted(_without_prefix(list(joints)), key=lambda pair: "study" not in pair[0])
        words = {joint: _words(name) for name, joint in pairs if joint not in without}
        plain = {"".join(each) for each in words.values()}
        self._joints = {side: {} for side in ("", *SIDES)}
        # Sides that come first are surer than those that come later.
        readings = zip(*(_readings(each, plain) for each in words.values()), strict=True)
        for reading in readings:
            for joint, (side, rest) in zip(words, reading, strict=True):
                self._joints[side].setdefault(rest, joint)
        self._are_markers = any(self.find(_SKIN, side) for side in SIDES)

    def find(self, text, side):
        """The joint of the first entry of a row that is there, or a tuple; None without any."""
        return next((at for entry in _entries(text) if (at := self._at(entry, side))), None)

    def find_pair(self, name, text=None):
        """The joints on both sides, by an entry that both have, or otherwise each by its first."""
        text = _JOINTS[name] if text is None else text
        both = ([self._at(entry, side) for side in SIDES] for entry in _entries(text))
        each = next((at for at in both if None not in at), None)
        each = [self.find(text, side) for side in SIDES] if each is None else each
        return {f"{side}_{name}": at for side, at in zip(SIDES, each, strict=True) if at}

    def find_clusters(self):
        """The markers on each segment, for the landmark at its near end."""
        clusters = {}
        for side, joints in self._joints.items():
            for name, text in _CLUSTERS.items():
                at = tuple(j for rest, j in joints.items() if re.fullmatch(rf"({text})\d+", rest))
                if len(at) > 1 and (name == "pelvis") == (not side):
                    clusters[f"{side}_{name}".lstrip("_")] = at
        return clusters

    def _at(self, entry, side):
        is_bone, members = entry
        if is_bone and self._are_markers:
            return None
        joints = self._joints[side]
        at = [next((joints[word] for word in words if word in joints), None) for words in members]
        if None in at or len(set(at)) < len(at):
            return None
        return at[0] if len(at) == 1 else tuple(at)


def _guess_by_parts(parts):
    """The joint or joints of each landmark, by the table."""
    guess = {}
    for name in ("pelvis", "neck", "head"):
        guess[name] = parts.find(_JOINTS[name], "")
    for name in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle"):
        guess |= parts.find_pair(name)
    has = {name for name in _JOINTS if f"left_{name}" in guess or f"right_{name}" in guess}
    if (joint := {"elbow", "knee"} - has) == {"elbow", "knee"}:
        joint = {"elbow"} if "shoulder" in has and "ankle" not in has else set()
    for name in joint:
        guess |= parts.find_pair(name, _EPICONDYLES)
    if guess["head"] is None:
        of_head = parts.find_pair("head", _SIDES_OF_HEAD)
        guess["head"] = tuple(of_head.values()) if len(of_head) == 2 else None
    if guess["pelvis"] is None:
        front, back = (parts.find_pair("", text) for text in (_FRONT, _BACK))
        sacrum = parts.find(_SACRUM, "")
        behind = (sacrum,) if len(back) < 2 and sacrum else tuple(back.values())
        if len(front) == 2 and behind:
            guess["pelvis"] = (*front.values(), *behind)
        elif "hip" not in has:
            guess["pelvis"] = sacrum
    return {name: at for name, at in guess.items() if at}


@functools.cache
def _entries(text):
    """The entries of a row: whether it is a bone, and for each joint the words that name it."""
    entries = []
    for entry in text.split():
        words = [member.split("|") for member in entry.strip("~*").split("+")]
        if entry.startswith("~"):
            stems = words[0]
            # Stems of a letter or two are too short to name a joint without another word.
            plain = [stem for stem in stems if len(stem) > 2]
            for group in (*([stem] for stem in stems), stems):
                outer, inner = (
                    [name for stem in group for w in places for name in (w + stem, stem + w)]
                    for places in (_OUTER, _INNER)
                )
                entries.append((False, [outer + [stem for stem in group if stem in plain], inner]))
            entries.append((False, [plain + outer]))
        else:
            entries.append((entry.endswith("*"), words))
    return entries


def _without_prefix(joints):
    """Pairs of the name of a joint without the prefix of all, and the joint."""
    # Programs put a prefix before every joint, except perhaps the root.
    prefix = re.match(r"(.*[^A-Za-z0-9])?", os.path.commonprefix(joints[1:])).group()  # noqa: RUF071
    # If one side was recorded, the side is in every name, and no prefix.
    prefix = re.sub(r"(?i)(?<![a-z0-9])(left|right|l|r)[^a-z0-9]+$", "", prefix)
    return [(joint.removeprefix(prefix), joint) for joint in joints]


def _plain(name):
    return re.sub(r"[^a-z0-9]", "", name.lower())


def _words(name):
    """The words of a name in small letters: "RKneeLat_study" has r, knee and lat."""
    words = re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+", name.rpartition(":")[2])
    words = [word.lower() for word in words]
    return [word for word in words if word not in _NO_PART] or words


def _readings(words, plain):
    """Two readings of a name, as a side and the rest: the side comes first, or it comes later."""
    whole = "".join(words)
    first = re.fullmatch("(left|right|l|r)x?(.+)", whole)
    yield (_SIDE_OF[first[1]], first[2]) if first else ("", whole)
    at = next((i for i, word in enumerate(words) if i and word in _SIDE_OF), None)
    last = re.fullmatch("(.+?)(left|right|l|r)", whole)
    word, rest = (last[2], last[1]) if last else ("", whole)
    if at is not None:
        word, rest = words[at], "".join(words[:at] + words[at + 1 :])
    # In "LWR" beside "RWR" the last letter is none, nor in "EPIl" beside "EPIm", which is lateral,
    # and "STYr" beside "STYu", which is radial.
    opposite = {"l": "r", "r": "l"}
    turned = opposite.get(whole[:1], "-") + whole[1:]
    is_other = rest + {"l": "m", "r": "u"}.get(word, "-") in plain
    if (at is None and turned in plain) or (is_other and rest + opposite[word] not in plain):
        yield "", whole
    else:
        yield _SIDE_OF.get(word, ""), rest
