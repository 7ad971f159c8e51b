"""Known skeletons: the joints of a recording format, the parent of each, and the landmarks."""

from typing import NamedTuple

# Axes of a position in the plane and in space.
AXES = {2: "xy", 3: "xyz"}
SIDES = ("left", "right")
# The fifteen joints of the paper's body model.
LANDMARKS = ["pelvis", "neck", "head"]
LANDMARKS += [
    f"{side}_{part}"
    for side in SIDES
    for part in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
]


class Format(NamedTuple):
    """Joints in the order in which a program writes them.

    Attributes
    ----------
    summary : str
        One sentence for the documentation.
    parents : dict of str to str or None
        The parent of each joint, in the order of the columns.
    landmarks : dict of str to str or tuple of str
        The joint of each landmark, or those whose mean it is.
    up : str
        The vertical axis in space.
    up_2d : str
        The vertical axis in a picture.
    """

    summary: str
    parents: dict
    landmarks: dict
    up: str = "y"
    up_2d: str = "-y"


def _format(summary, joints, landmarks, **up):
    """A format from two tables in text.

    Parameters
    ----------
    summary : str
    joints : str
        The joints in the order of the columns: ``name<parent``, ``>name`` for a child of the joint
        before it, or ``name`` for a root.
    landmarks : str
        The joint at each of `LANDMARKS`: ``a+b`` is the mean of two joints, ``-`` stands for none.
    **up : str
        The vertical axes where they are not the default.
    """
    parents, previous = {}, None
    for item in joints.split():
        name, _, parent = item.removeprefix(">").partition("<")
        parents[name] = previous if item.startswith(">") else parent or None
        previous = name
    at = {
        landmark: tuple(names.split("+")) if "+" in names else names
        for landmark, names in zip(LANDMARKS, landmarks.split(), strict=True)
        if names != "-"
    }
    return Format(summary, parents, at, **up)


# Names of joints are compared with the formats in this order: the most complete come first.
FORMATS = {
    "acclaim": _format(
        "The 31 joints of HDM05 and of CMU's ASF/AMC files.",
        """root >lhipjoint rhipjoint<root lowerback<root lfemur<lhipjoint >ltibia >lfoot >ltoes
        rfemur<rhipjoint >rtibia >rfoot >rtoes upperback<lowerback >thorax >lowerneck
        lclavicle<thorax rclavicle<thorax upperneck<lowerneck >head lhumerus<lclavicle >lradius
        >lwrist >lhand lthumb<lwrist lfingers<lhand rhumerus<rclavicle >rradius >rwrist >rhand
        rthumb<rwrist rfingers<rhand""",
        """root thorax head lclavicle lhumerus lradius lhipjoint lfemur ltibia rclavicle rhumerus
        rradius rhipjoint rfemur rtibia""",
        up_2d="y",
    ),
    "kinect": _format(
        "The 20 joints of the first Kinect.",
        """HipCenter >Spine >ShoulderCenter >Head ShoulderLeft<ShoulderCenter >ElbowLeft >WristLeft
        >HandLeft ShoulderRight<ShoulderCenter >ElbowRight >WristRight >HandRight HipLeft<HipCenter
        >KneeLeft >AnkleLeft >FootLeft HipRight<HipCenter >KneeRight >AnkleRight >FootRight""",
        """HipCenter ShoulderCenter Head ShoulderLeft ElbowLeft WristLeft HipLeft KneeLeft AnkleLeft
        ShoulderRight ElbowRight WristRight HipRight KneeRight AnkleRight""",
    ),
    "paper": _format(
        "The fifteen joints of the paper's body model.",
        """pelvis >neck >head left_shoulder<neck >left_elbow >left_wrist left_hip<pelvis >left_knee
        >left_ankle right_shoulder<neck >right_elbow >right_wrist right_hip<pelvis >right_knee
        >right_ankle""",
        """pelvis neck head left_shoulder left_elbow left_wrist left_hip left_knee left_ankle
        right_shoulder right_elbow right_wrist right_hip right_knee right_ankle""",
        up_2d="y",
    ),
    "kinect_v2": _format(
        "The 25 joints of the second Kinect and, in the same order, of NTU RGB+D.",
        """SpineBase >SpineMid Neck<SpineShoulder >Head ShoulderLeft<SpineShoulder >ElbowLeft
        >WristLeft >HandLeft ShoulderRight<SpineShoulder >ElbowRight >WristRight >HandRight
        HipLeft<SpineBase >KneeLeft >AnkleLeft >FootLeft HipRight<SpineBase >KneeRight >AnkleRight
        >FootRight SpineShoulder<SpineMid HandTipLeft<HandLeft ThumbLeft<HandLeft
        HandTipRight<HandRight ThumbRight<HandRight""",
        """SpineBase SpineShoulder Head ShoulderLeft ElbowLeft WristLeft HipLeft KneeLeft AnkleLeft
        ShoulderRight ElbowRight WristRight HipRight KneeRight AnkleRight""",
    ),
    "openpose": _format(
        "The 25 key-points of OpenPose, BODY_25; the head is the nose.",
        """Nose<Neck Neck<MidHip >RShoulder >RElbow >RWrist LShoulder<Neck >LElbow >LWrist MidHip
        >RHip >RKnee >RAnkle LHip<MidHip >LKnee >LAnkle REye<Nose LEye<Nose REar<REye LEar<LEye
        LBigToe<LAnkle >LSmallToe LHeel<LAnkle RBigToe<RAnkle >RSmallToe RHeel<RAnkle""",
        """MidHip Neck Nose LShoulder LElbow LWrist LHip LKnee LAnkle RShoulder RElbow RWrist RHip
        RKnee RAnkle""",
    ),
    "mediapipe": _format(
        "The 33 landmarks of MediaPipe's pose; the head is the nose.",
        """nose >left_eye_inner >left_eye >left_eye_outer right_eye_inner<nose >right_eye
        >right_eye_outer left_ear<left_eye_outer right_ear<right_eye_outer mouth_left >mouth_right
        left_shoulder<left_hip >right_shoulder left_elbow<left_shoulder right_elbow<right_shoulder
        left_wrist<left_elbow right_wrist<right_elbow left_pinky<left_wrist right_pinky<right_wrist
        left_index<left_wrist right_index<right_wrist left_thumb<left_wrist right_thumb<right_wrist
        left_hip >right_hip left_knee<left_hip right_knee<right_hip left_ankle<left_knee
        right_ankle<right_knee left_heel<left_ankle right_heel<right_ankle left_foot_index<left_heel
        right_foot_index<right_heel""",
        """left_hip+right_hip left_shoulder+right_shoulder nose left_shoulder left_elbow left_wrist
        left_hip left_knee left_ankle right_shoulder right_elbow right_wrist right_hip right_knee
        right_ankle""",
        up="-y",
    ),
    "coco": _format(
        "The 17 key-points of COCO; the head is the nose.",
        """nose >left_eye right_eye<nose left_ear<left_eye right_ear<right_eye
        left_shoulder<left_hip >right_shoulder left_elbow<left_shoulder right_elbow<right_shoulder
        left_wrist<left_elbow right_wrist<right_elbow left_hip >right_hip left_knee<left_hip
        right_knee<right_hip left_ankle<left_knee right_ankle<right_knee""",
        """left_hip+right_hip left_shoulder+right_shoulder nose left_shoulder left_elbow left_wrist
        left_hip left_knee left_ankle right_shoulder right_elbow right_wrist right_hip right_knee
        right_ankle""",
    ),
    "plug_in_gait": _format(
        "Joint centres and segment origins of Vicon's Plug-in Gait.",
        """PELO >LHJC >LKJC >LAJC RHJC<PELO >RKJC >RAJC TRXO<PELO >HEDO LSJC<TRXO >LEJC >LWJC
        RSJC<TRXO >REJC >RWJC""",
        """PELO TRXO HEDO LSJC LEJC LWJC LHJC LKJC LAJC RSJC REJC RWJC RHJC RKJC RAJC""",
        up="z",
    ),
}
