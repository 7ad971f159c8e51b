"""What the points and the analog channels of a C3D file are: groups, names, units, scales."""

import math

# What writers compute from markers and store as points, beside others that have units.
_COMPUTED = ("ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS", "REACTIONS")


def find_labels(parameters, group, n, what):
    """A name for each of n, though labels may lack or come in several parameters."""
    labels = parameters.all_texts(group, "LABELS")
    labels = (labels + [""] * n)[:n]
    return [label or f"{what}_{i + 1}" for i, label in enumerate(labels)]


def find_point_groups(parameters, labels):
    """Indices and units of the points of each group, by name; markers are the rest.

    POINT:ANGLES lists the labels of the points that are angles, POINT:ANGLE_UNITS says what
    they are measured in; forces, moments and others likewise.
    """
    left = dict.fromkeys(range(len(labels)))
    groups = {}
    for name in _group_names(parameters):
        listed = {label.upper() for label in parameters.all_texts("POINT", name)}
        points = [i for i in left if labels[i].upper() in listed]
        if points:
            units = parameters.text("POINT", f"{name.removesuffix('S')}_UNITS")
            groups[name.lower()] = (points, units)
            for i in points:
                del left[i]
    return {"markers": (list(left), parameters.text("POINT", "UNITS"))} | groups


def _group_names(parameters):
    there = parameters.names("POINT")
    markers = parameters.text("POINT", "UNITS")
    # Points in the unit of markers, such as centres of joints, are as good as markers.
    others = {
        f"{name.removesuffix('_UNITS')}S"
        for name in there
        if name.endswith("_UNITS") and parameters.text("POINT", name) != markers
    } - {"LABELS", "DESCRIPTIONS", "MARKERS"}
    return [name for name in dict.fromkeys([*_COMPUTED, *sorted(others)]) if name in there]


def find_channels(parameters, n):
    """Labels and units of the n analog channels."""
    units = (parameters.all_texts("ANALOG", "UNITS") + [""] * n)[:n]
    return find_labels(parameters, "ANALOG", n, "channel"), [unit or None for unit in units]


def find_scales(file, parameters, n):
    """Kind of the raw integers of the n channels, what to subtract, what to multiply with."""
    unsigned = (parameters.text("ANALOG", "FORMAT") or "").upper() == "UNSIGNED"
    kind = "u" if unsigned else "i"
    general = parameters.number("ANALOG", "GEN_SCALE", 1.0)
    offsets = _one_each(file, parameters.all_numbers("ANALOG", "OFFSET", kind), "OFFSET", n, 0.0)
    scales = _one_each(file, parameters.all_numbers("ANALOG", "SCALE"), "SCALE", n, 1.0)
    if not general or not all(map(math.isfinite, [general, *offsets, *scales])):
        raise file.error(
            f"ANALOG:GEN_SCALE must not be 0, and it, ANALOG:SCALE and ANALOG:OFFSET must be "
            f"finite, got GEN_SCALE {general:g}, SCALE from {min(scales):g} to {max(scales):g}, "
            f"OFFSET from {min(offsets):g} to {max(offsets):g}"
        )
    return kind, offsets, [general * scale for scale in scales]


def _one_each(file, numbers, name, n, default):
    if numbers and len(numbers) < n:
        raise file.error(f"ANALOG:{name} has {len(numbers)} numbers for {n} channels")
    return numbers[:n] or [default] * n
