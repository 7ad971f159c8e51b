"""Files that are written as a whole or not at all."""

import pathlib
import uuid


def check_path(path, example):
    """A path at which a file can be written, such as ``example``."""
    path = pathlib.Path(path)
    if path.exists() and not path.is_file():
        raise ValueError(
            f"path must be that of a file, such as '{example}'; {str(path)!r} is a folder or a "
            "device."
        )
    if not path.parent.is_dir():
        raise FileNotFoundError(
            f"There is no folder {str(path.parent)!r} for the {pathlib.Path(example).stem} "
            f"{path.name!r}: make it by Path.mkdir(parents=True), or give the path of another file."
        )
    return path


def write_whole(path, text):
    """Write a text; where that fails, the file at the path is as it was."""
    # The file that a link leads to is replaced, and keeps its permissions.
    target = path.resolve()
    beside = target.with_name(f".{uuid.uuid4().hex}")
    try:
        beside.touch()
        if target.exists():
            # What must not be written to is not replaced.
            target.open("r+b").close()
            beside.chmod(target.stat().st_mode & 0o777)
        # Names of files may hold what is no letter.
        beside.write_bytes(text.encode("utf-8", "replace"))
        beside.replace(target)
    finally:
        beside.unlink(missing_ok=True)
