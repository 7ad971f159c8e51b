"""What is public: the names of the package, and of its rooms, by the names they have there."""

import inspect
import pkgutil
from importlib import import_module

import sklearn_motionsync

_NAMES = (module.name for module in pkgutil.iter_modules(sklearn_motionsync.__path__))
_MODULES = {name: import_module(f"sklearn_motionsync.{name}") for name in _NAMES}
# Rooms without names of their own are internal.
ROOMS = {name: module for name, module in _MODULES.items() if hasattr(module, "__all__")}
# {name: object}: what stands at the top and in a room is one.
OBJECTS = {
    name: getattr(module, name)
    for module in (*ROOMS.values(), sklearn_motionsync)
    for name in module.__all__
}


def functions():
    """Public functions and methods by name: ``find_trials``, ``ActionModel.fit``."""
    for name, each in OBJECTS.items():
        yield name, each
        if inspect.isclass(each):
            for key, member in inspect.getmembers(each, inspect.isroutine):
                if not key.startswith(("_", "set_")):
                    yield f"{name}.{key}", member
