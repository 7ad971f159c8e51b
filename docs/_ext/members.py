"""The methods of a class: those of the package, and those it has from scikit-learn."""

import inspect
import re

PACKAGE = "sklearn_motionsync"
# "accuracy <accuracy_score>": a label of scikit-learn's manual, which this one does not have.
_LABELLED = re.compile(r":ref:`([^`<]*?)\s*<[^`>]*>`")


def members(cls):
    """What the page of a class lists, as plain data for its template."""
    own, properties, inherited = [], [], []
    names = [name for name in dir(cls) if not name.startswith("_") or name == "__call__"]
    for name in names:
        home, value = _definition(cls, name)
        if isinstance(value, property):
            properties.append(name)
        elif not callable(getattr(cls, name)):
            continue
        elif home == PACKAGE:
            own.append(name)
        elif home == "sklearn":
            inherited.append(_entry(cls, name))
    return {"own": own, "properties": properties, "inherited": inherited}


def _definition(cls, name):
    """Package that defines a member, and the member as its class holds it."""
    for base in cls.__mro__:
        if name in vars(base):
            value = vars(base)[name]
            # Descriptors of scikit-learn's, and functions of its that we only wrap.
            makers = {type(value).__module__, getattr(value, "__module__", None) or ""}
            of_sklearn = any(maker.split(".")[0] == "sklearn" for maker in makers)
            return "sklearn" if of_sklearn else base.__module__.split(".")[0], value
    return None, None


def _entry(cls, name):
    method = getattr(cls, name)
    parameters = list(inspect.signature(method).parameters.values())
    if parameters and parameters[0].name == "self":
        parameters = parameters[1:]
    shown = [p.replace(annotation=inspect.Parameter.empty) for p in parameters]
    signature = str(inspect.Signature(shown))
    summary = inspect.getdoc(method).strip().split("\n\n")[0].replace("\n", " ")
    summary = _LABELLED.sub(r"\1", summary)
    return {"name": name, "signature": signature, "summary": summary}
