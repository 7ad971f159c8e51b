"""The linear algebra of a portion runs on one thread, and the process is left as it was found.

The number of threads of a BLAS library is a setting of the whole process, or, if it runs on OpenMP,
of each thread. Whoever comes first limits it and remembers what was there; whoever goes last
restores it, unless somebody else has changed it meanwhile.
"""

import functools
import os
import sys
import threading

from threadpoolctl import ThreadpoolController

__all__ = ["on_one_thread"]


def on_one_thread(function, *arguments):
    """``function(*arguments)``, with one thread for linear algebra."""
    # An interruption can come between any two steps: entering may end half-way, leaving may be
    # done twice, and neither harms.
    visitor = object()
    try:
        for limit in _known_limits():
            limit.enter(visitor)
        return function(*arguments)
    finally:
        try:
            _leave(visitor)
        except BaseException:
            _leave(visitor)
            raise


def _leave(visitor):
    for limit in tuple(_limits.values()):
        limit.leave(visitor)


class _Visitors:
    """Who is inside, and the number of threads there was before: None if nobody is."""

    def __init__(self):
        self.inside, self.before = set(), None


class _VisitorsOfThread(_Visitors, threading.local):
    """The same for each thread."""


class Limit:
    """The limit of one library: one thread while anybody is inside.

    Parameters
    ----------
    library : threadpoolctl.LibController
    """

    def __init__(self, library):
        self._library = library
        # OpenMP keeps the number of threads for each thread that asks.
        of_thread = getattr(library, "threading_layer", None) == "openmp"
        self._visitors = _VisitorsOfThread() if of_thread else _Visitors()
        # Re-entered by a signal handler that warps, too.
        self._lock = threading.RLock()

    def enter(self, visitor):
        """Limit the library, if nobody has done so before."""
        with self._lock:
            # Read before anybody is inside: what is remembered is never a limit of ours.
            visitors, threads = self._visitors, self._library.num_threads
            visitors.inside.add(visitor)
            if visitors.before is None:
                visitors.before = threads
            if threads != 1:
                self._set(1)

    def leave(self, visitor):
        """Restore the library, if nobody else is inside; whoever is not inside changes nothing."""
        with self._lock:
            visitors = self._visitors
            visitors.inside.discard(visitor)
            if not visitors.inside:
                self._restore(visitors)

    def after_fork(self):
        """In a child: whoever was inside is so in the parent."""
        self._lock = threading.RLock()
        self._visitors.inside.clear()
        self._restore(self._visitors)

    def _restore(self, visitors):
        if visitors.before not in (None, 1) and self._library.num_threads == 1:
            self._set(visitors.before)
        visitors.before = None

    def _set(self, n_threads):
        # Since 3.8 threadpoolctl lets one thread alone set OpenBLAS, silently: the first to come
        # and the last to go need not be the same.
        clear = getattr(self._library, "clear_controlling_thread", None)
        if clear is not None:
            clear(force=True)
        self._library.set_num_threads(n_threads)
        if clear is not None:
            clear(force=True)


# The limits by their libraries' files, and of how many modules the libraries are known.
_limits, _n_modules = {}, 0


def _known_limits():
    """The limits of all libraries, also of those that came with a module loaded since."""
    global _n_modules
    if _n_modules != len(sys.modules):
        _heed_forks()
        n_modules = len(sys.modules)
        for library in ThreadpoolController().lib_controllers:
            if library.user_api == "blas":
                _limits.setdefault(library.filepath, Limit(library))
        _n_modules = n_modules
    return tuple(_limits.values())


def _after_fork():
    for limit in _limits.values():
        limit.after_fork()


@functools.cache
def _heed_forks():
    if hasattr(os, "register_at_fork"):
        os.register_at_fork(after_in_child=_after_fork)
