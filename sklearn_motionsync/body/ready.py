"""Ready skeletons: those whose joints are known by heart."""

from .formats import FORMATS

__all__ = ["ReadySkeletons"]


class ReadySkeletons:
    """Ways to make a `Skeleton` without naming a joint.

    ``n_dims`` is 3, or 2 for positions in a picture. ``up`` is the vertical axis; by default the
    one that is usual with the format, which in pictures is "-y".
    """

    @classmethod
    def paper(cls, *, n_dims=3, up=None):
        """The paper's fifteen joints; "y" is up."""
        return cls._ready("paper", n_dims, up)

    @classmethod
    def acclaim(cls, *, n_dims=3, up=None):
        """The 31 joints of HDM05 and of CMU's ASF/AMC files; "y" is up."""
        return cls._ready("acclaim", n_dims, up)

    @classmethod
    def kinect(cls, *, n_dims=3, up=None):
        """The 20 joints of the first Kinect; "y" is up."""
        return cls._ready("kinect", n_dims, up)

    @classmethod
    def kinect_v2(cls, *, n_dims=3, up=None):
        """The 25 joints of the second Kinect, and of NTU RGB+D in the same order; "y" is up."""
        return cls._ready("kinect_v2", n_dims, up)

    @classmethod
    def openpose(cls, *, n_dims=3, up=None):
        """OpenPose's 25 key-points, BODY_25; "y" is up in space. The head is the nose."""
        return cls._ready("openpose", n_dims, up)

    @classmethod
    def coco(cls, *, n_dims=3, up=None):
        """The 17 key-points of COCO; "y" is up in space.

        The pelvis is the mean of the hips, the neck that of the shoulders, the head the nose.
        """
        return cls._ready("coco", n_dims, up)

    @classmethod
    def mediapipe(cls, *, n_dims=3, up=None):
        """The 33 landmarks of MediaPipe's pose; "-y" is up, in space as in pictures.

        The pelvis is the mean of the hips, the neck that of the shoulders, the head the nose.
        """
        return cls._ready("mediapipe", n_dims, up)

    @classmethod
    def opencap(cls, *, n_dims=3, up=None):
        """The 20 video key-points of OpenCap, which have no head; "y" is up."""
        return cls._ready("opencap", n_dims, up)

    @classmethod
    def plug_in_gait(cls, *, n_dims=3, up=None):
        """Joint centres of Vicon's Plug-in Gait, and origins of its bones; "z" is up.

        The pelvis is ``PELO``, the neck the thorax' ``TRXO``, the head ``HEDO``. A file without
        them has fewer limbs: use ``Skeleton.from_frame``.
        """
        return cls._ready("plug_in_gait", n_dims, up)

    @classmethod
    def optitrack(cls, *, n_dims=3, up=None):
        """The 21 bones of a skeleton of OptiTrack's Motive; "y" is up."""
        return cls._ready("optitrack", n_dims, up)

    @classmethod
    def unreal(cls, *, n_dims=3, up=None):
        """The body of Unreal Engine's mannequin, 22 bones; "z" is up."""
        return cls._ready("unreal", n_dims, up)

    @classmethod
    def _ready(cls, name, n_dims, up):
        known = FORMATS[name]
        joints = list(known.parents)
        parents = [joints.index(p) if p else -1 for p in known.parents.values()]
        if up is None:
            up = known.up_in_pictures if n_dims == 2 else known.up
        return cls(joints, parents, known.landmarks, up, n_dims)
