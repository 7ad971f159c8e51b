"""Words of messages and reprs."""


def counted(n, noun):
    """A number and its noun: "1 frame", "2 frames"."""
    number = f"{n:g}" if isinstance(n, float) else n
    return f"{number} {noun}" if n == 1 else f"{number} {noun}s"


def within(name):
    """A name that begins a sentence, as it stands within one: "trial 3"."""
    return name[:1].lower() + name[1:]
