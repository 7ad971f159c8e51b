"""The guard of the readers: no result out of all proportion to its file."""

# A small file may stand for a huge result (many joints that never move, many short frames, a
# compressed archive of zeros). No recording does: its result is about as large as its file.
_LARGE = 64 * 2**20
_MAX_GROWTH = 32


def check_growth(path, size, n_bytes, what):
    """Refuse a result of `n_bytes` from a file of `size` bytes, before it is made."""
    if n_bytes > max(_LARGE, _MAX_GROWTH * size):
        raise ValueError(
            f"{path}: {what} would take {n_bytes / 2**20:.0f} MB, from a file of "
            f"{size / 2**20:.2f} MB. No recording grows like that, so the file is taken for "
            "damaged. Remove the joints or the frames that are not needed."
        )
