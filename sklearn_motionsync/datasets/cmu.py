"""The motion capture database of Carnegie Mellon University, clip by clip."""

from collections.abc import Sequence
from numbers import Integral, Real
from pathlib import Path as FilePath

import numpy as np
from sklearn.utils import Bunch
from sklearn.utils._param_validation import Interval

from ..body.skeleton import Skeleton
from ..inputs.types import Path
from ..io.motion import read_motion
from ..utils.parameters import validated_function

_FRAME_RATE = 120.0
_DESCR = """\
CMU Graphics Lab Motion Capture Database, mocap.cs.cmu.edu: optical motion capture of a
person ("subject") in many takes ("trials"), as Acclaim ASF/AMC files, 120 frames a second.
Positions are in metres, the y axis is up, a joint is the far end of the bone of its name.

Terms, in the words of the site: "This dataset of motions is free for all uses." and "This
data is free for use in research projects. You may include this data in commercially-sold
products, but you may not resell this data directly, even in converted form."

Acknowledgement: "The data used in this project was obtained from mocap.cs.cmu.edu.
The database was created with funding from NSF EIA-0196217."
"""


@validated_function(
    {
        "download_if_missing": ["boolean"],
        "url": [str],
        "n_retries": [Interval(Integral, 0, None, closed="left")],
        "delay": [Interval(Real, 0, 3600, closed="both")],
    }
)
def fetch_cmu(
    subject: int | str,
    trials: int | str | Sequence[int | str],
    *,
    data_home: Path | None = None,
    download_if_missing: bool = True,
    url: str = "http://mocap.cs.cmu.edu/subjects",
    n_retries: int = 3,
    delay: float = 1.0,
) -> Bunch:
    """Load trials of one subject of the CMU motion capture database, downloaded where needed.

    Parameters
    ----------
    subject : int or str
        Number of the subject, such as 2 or "02".
    trials : int, str, or list of them
        Numbers of the trials.
    data_home : str or path-like, default=None
        Files are kept in ``cmu_mocap/<subject>`` of this folder, by default scikit-learn's
        (see `sklearn.datasets.get_data_home`).
    download_if_missing : bool, default=True
        Whether to download missing files; if False they are an error.
    url : str, default="http://mocap.cs.cmu.edu/subjects"
        Address of the folders of the subjects.
    n_retries : int, default=3
        Number of further attempts after the network failed.
    delay : float, default=1.0
        Seconds between attempts, up to an hour.

    Returns
    -------
    Bunch
        data : list of DataFrame (n_frames_i, 3 * n_joints)
            Joint positions in metres, as ``read_motion`` returns them.
        subject : str
            Number of the subject, in two digits.
        take : ndarray of str (n_trials,)
            Numbers of the trials, in two digits.
        joints : list of str
            Names of the joints.
        skeleton : Skeleton or None
            None if the landmarks of a body cannot be found by the names of the joints.
        frame_rate : ndarray (n_trials,)
            Frames per second: 120.
        units : str
            The unit of the positions, "m".
        filenames : list of str
            Paths of the AMC files.
        DESCR : str
            Terms of use, and the acknowledgement that the site requests.

    Raises
    ------
    FileNotFoundError
        If the site has no such subject or trial.
    OSError
        If a file is missing and cannot be downloaded.
    ValueError
        If a parameter is out of its range, or a file cannot be read.

    Warns
    -----
    UserWarning
        If a download is tried again.

    See Also
    --------
    sklearn_motionsync.io.read_motion : Reads the files.

    Examples
    --------
    >>> from sklearn_motionsync.datasets import fetch_cmu
    >>> walks = fetch_cmu(2, [1, 2])  # doctest: +SKIP
    >>> walks.data[0].shape  # doctest: +SKIP
    (343, 93)
    """
    from sklearn.datasets import get_data_home

    subject = _two_digits(subject, "subject")
    takes = [_two_digits(trial, "trials") for trial in np.atleast_1d(trials).tolist()]
    if not takes:
        raise ValueError("trials must be one number or several, got none.")
    folder = FilePath(get_data_home(data_home)) / "cmu_mocap" / subject
    names = [f"{subject}.asf", *(f"{subject}_{take}.amc" for take in takes)]
    for name in names:
        if (folder / name).is_file():
            continue
        address = f"{url.rstrip('/')}/{subject}/{name}"
        if not download_if_missing:
            raise OSError(_describe_missing(folder / name, address, "download_if_missing is False"))
        _download(address, folder / name, n_retries, delay)
    asf, *files = (folder / name for name in names)
    try:
        data = [read_motion(file, asf=asf, frame_rate=_FRAME_RATE) for file in files]
    except ValueError as error:
        raise ValueError(f"{error} Delete that file to get it again.") from error
    joints = data[0].attrs["joints"]
    try:
        skeleton = Skeleton(joints, data[0].attrs["parents"])
    except ValueError:
        skeleton = None
    return Bunch(
        data=data,
        subject=subject,
        take=np.array(takes),
        joints=joints,
        skeleton=skeleton,
        frame_rate=np.full(len(takes), _FRAME_RATE),
        units="m",
        filenames=[str(file) for file in files],
        DESCR=_DESCR,
    )


def _two_digits(number: int | str, name: str) -> str:
    text = str(number)
    # The number becomes part of a path, so it must be a number.
    if not (text.isascii() and text.isdigit() and len(text) <= 4 and int(text)):
        raise ValueError(f"{name} must be numbers from 1, such as 2 or '02', got {number!r}.")
    return f"{int(text):02d}"


def _describe_missing(path, address, reason):
    return (
        f"{path.name} is not in {path.parent} and could not be got from {address}: {reason}. "
        "Download it by hand into that folder, or give another url=."
    )


def _download(address, path, n_retries, delay):
    """Fetch one file, which gets its name when it is complete."""
    from http.client import HTTPException
    from urllib.error import HTTPError

    from sklearn.datasets import fetch_file

    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        fetch_file(address, path.parent, path.name, n_retries=n_retries, delay=delay)
    except HTTPError as error:
        error.close()
        if error.code not in (404, 410):
            raise OSError(_describe_missing(path, address, error)) from error
        raise FileNotFoundError(
            f"There is no {path.name} at {address} (HTTP {error.code}); that subject or trial does "
            "not exist there. Look for its number on the site, or give another url=."
        ) from error
    except (OSError, HTTPException) as error:
        raise OSError(_describe_missing(path, address, error)) from error
