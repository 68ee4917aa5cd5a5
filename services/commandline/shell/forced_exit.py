"""Ends of a process whose Python does not come to its signals: a driver blocks in C, and does not come back.

A handler of Python's runs between two steps of Python. So the system itself is told, before anything blocks, what to
do then. On other systems than Linux with glibc nothing is told, and only SIGKILL (or Ctrl-\\) ends such a process.
"""

import ctypes
import signal
import sys
from contextlib import suppress
from typing import Any

from engage_hri.schemas.units import Seconds

_PARENT_DIED = signal.SIGUSR2 if sys.platform == "linux" else 0
PATIENCE: Seconds = float(_PARENT_DIED)
"""Time in which a process whose parent has died is to end by itself: the number of the signal that tells of it, for
the handler of that signal is the system's `alarm`, which takes a number of seconds."""
_PR_SET_PDEATHSIG = 1
_DEFAULT = 0


def end_at_the_second(number: signal.Signals) -> None:
    """Let the system end the process at a second signal, if Python has not taken up the first by then.

    number: of a signal that has a handler of Python's. Whoever handles it sets the handler anew.
    """
    with suppress(OSError, AttributeError, TypeError):
        library = _library()
        handler = library.signal(number, _DEFAULT)
        library.sysv_signal(number, handler)


def end_after_the_parent() -> None:
    """Let the system end the process some `PATIENCE` after its parent has died, if it has not ended by itself."""
    with suppress(OSError, AttributeError, TypeError):
        library = _library()
        library.signal(_PARENT_DIED, ctypes.cast(library.alarm, ctypes.c_void_p))
        library.prctl(_PR_SET_PDEATHSIG, _PARENT_DIED)


def _library() -> Any:
    """The library of C. Raises OSError, AttributeError or TypeError: it is another one."""
    if sys.platform != "linux":
        raise OSError
    library = ctypes.CDLL(None)
    for function in (library.signal, library.sysv_signal):
        function.restype, function.argtypes = ctypes.c_void_p, (ctypes.c_int, ctypes.c_void_p)
    return library
