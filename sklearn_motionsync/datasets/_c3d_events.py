"""When a C3D file begins, and the events that somebody marked in it."""

import math

import numpy as np

# The header has room for so many events, and this number where their labels have 4 characters.
_MOST = 18
_LONG_LABELS = 12345


def find_first_frame(file, parameters):
    """The number that the first frame has in its trial, which mostly counts from 1."""
    start = parameters.numbers("TRIAL", "ACTUAL_START_FIELD")
    if start is None or not np.isfinite(start).all() or (start < 0).any():
        return file.integer(6)
    # Two words of 16 bits, the lower first.
    return int(start[0]) + (65536 * int(start[1]) if len(start) > 1 else 0)


def find_events(file, parameters, rate, first_frame):
    """Events by time, and how many have none.

    Each is a dict of its label, its context, its time in seconds of the trial, and its frame
    in the recording, from 0; None where the frame rate is not known.
    """
    # Frame 1 of the trial is at 0 seconds. Who counts from 0 means the same frame.
    begin = max(first_frame - 1, 0)
    found = _read_parameters(parameters)
    if found is None:
        found = _read_header(file, 0.0 if rate is None else begin / rate)
    events = [
        {
            "label": label,
            "context": context or None,
            "time": time,
            "frame": None if rate is None else round(time * rate - begin, 5),
        }
        # The file's numbers have 24 bits.
        for label, context, time in ((*texts, round(time, 6)) for *texts, time in found)
        if math.isfinite(time)
    ]
    return sorted(events, key=lambda event: event["time"]), len(found) - len(events)


def _read_parameters(parameters):
    """(label, context, time) of each event of the group EVENT; None without any."""
    group = next((g for g in ("EVENT", "EVENTS") if "TIMES" in parameters.names(g)), "EVENT")
    # Pairs of minutes and seconds.
    times = np.array(parameters.all_numbers(group, "TIMES"))
    times = times[: len(times) // 2 * 2].reshape(-1, 2) @ [60.0, 1.0]
    n = parameters.number(group, "USED", len(times))
    n = int(n) if n in range(65536) else len(times)
    if not n:
        return None
    columns = [parameters.all_texts(group, name) for name in ("LABELS", "CONTEXTS")]
    labels, contexts = ((texts + [""] * n)[:n] for texts in columns)
    times = [*times.tolist(), *[math.nan] * n][:n]
    return list(zip(labels, contexts, times, strict=True))


def _read_header(file, begin):
    """The same of the events in the header, whose times count from the first frame."""
    n = file.integer(300)
    if n > _MOST:
        return []
    width = 4 if file.integer(298) == _LONG_LABELS else 2
    labels = (file.data[396 + width * i : 396 + width * (i + 1)] for i in range(n))
    return [
        (label.decode("latin-1").replace("\0", " ").strip(), "", begin + file.float(304 + 4 * i))
        for i, label in enumerate(labels)
    ]
