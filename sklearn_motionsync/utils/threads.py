"""The linear algebra of a portion runs on one thread; afterwards the process is as before.

The number of threads of a BLAS library is a setting of the whole process, or, if it runs on OpenMP,
of each thread. The first call limits it and remembers the number before; the last call restores
that number, unless it was changed meanwhile.
"""

import functools
import os
import sys
import threading

from threadpoolctl import ThreadpoolController

__all__ = ["on_one_thread"]


def on_one_thread(function, *arguments):
    """``function(*arguments)``, with one thread for linear algebra."""
    # An interruption can come between any two steps: acquiring may end half-way, and releasing
    # twice is as once.
    holder = object()
    try:
        for limit in _known_limits():
            limit.acquire(holder)
        return function(*arguments)
    finally:
        try:
            _release(holder)
        except BaseException:
            _release(holder)
            raise


def _release(holder):
    for limit in tuple(_limits.values()):
        limit.release(holder)


class _Holders:
    """The holders of a limit, and the number of threads before the first; None without holders."""

    def __init__(self):
        self.holders, self.before = set(), None


class _HoldersOfThread(_Holders, threading.local):
    """The same for each thread."""


class Limit:
    """One thread for a library as long as the limit has holders.

    Parameters
    ----------
    library : threadpoolctl.LibController
    """

    def __init__(self, library):
        self._library = library
        # OpenMP keeps a number of threads for each thread.
        of_thread = getattr(library, "threading_layer", None) == "openmp"
        self._state = _HoldersOfThread() if of_thread else _Holders()
        # A signal handler may enter again.
        self._lock = threading.RLock()

    def acquire(self, holder):
        """Add a holder; the first one limits the library."""
        with self._lock:
            # Read before there is a holder, so that it is never a limit of ours.
            state, n_threads = self._state, self._library.num_threads
            state.holders.add(holder)
            if state.before is None:
                state.before = n_threads
            if n_threads != 1:
                self._set(1)

    def release(self, holder):
        """Remove a holder, if it is one; without any the library is restored."""
        with self._lock:
            self._state.holders.discard(holder)
            if not self._state.holders:
                self._restore()

    def after_fork(self):
        """Restore the library in a child process, whose parent has the holders."""
        self._lock = threading.RLock()
        self._state.holders.clear()
        self._restore()

    def _restore(self):
        state = self._state
        if state.before not in (None, 1) and self._library.num_threads == 1:
            self._set(state.before)
        state.before = None

    def _set(self, n_threads):
        # Since 3.8 threadpoolctl lets one thread alone set OpenBLAS, silently: the first and the
        # last holder may be of different threads.
        clear = getattr(self._library, "clear_controlling_thread", lambda force: None)
        clear(force=True)
        self._library.set_num_threads(n_threads)
        clear(force=True)


# The limits by their libraries' files, and the number of modules when they were listed.
_limits, _n_modules = {}, 0


def _known_limits():
    """The limits of all libraries, also of those of modules that were loaded since."""
    global _n_modules
    if _n_modules != len(sys.modules):
        _register_at_fork()
        n_modules = len(sys.modules)
        for library in ThreadpoolController().lib_controllers:
            if library.user_api == "blas":
                _limits.setdefault(library.filepath, Limit(library))
        _n_modules = n_modules
    return tuple(_limits.values())


@functools.cache
def _register_at_fork():
    if hasattr(os, "register_at_fork"):
        os.register_at_fork(after_in_child=_after_fork)


def _after_fork():
    for limit in _limits.values():
        limit.after_fork()
