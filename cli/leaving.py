"""How the process of a command ends: at once, when all that is to be done at an end has been done.

Icechunk reads on threads of its own, and they answer in Python. After an error there may be answers on their way, and
one that comes while Python takes itself apart ends the process with a panic of that thread, or with SIGABRT and exit
status 134 instead of that of the command. Icechunk has no call that waits for its threads, so Python is not taken
apart once they have been started. Nor is the event loop of Zarr closed, which Zarr would do at the end: answers to a
closed loop are tracebacks on standard error.
"""

from __future__ import annotations

import atexit
import os
import sys
from typing import NoReturn

_ENGINE = "icechunk"
_LOOP = "zarr.core.sync"
_READER_GONE = 1
_UNWRITTEN = 2


def leave(status: int) -> NoReturn:
    """End this process with an exit status, or with another one where what was printed cannot be written.

    Everything that was registered for the end is done first, in the order in which Python does it.
    """
    if _ENGINE not in sys.modules:
        sys.exit(status)
    if (loop := sys.modules.get(_LOOP)) is not None:
        atexit.unregister(loop.cleanup_resources)
    atexit._run_exitfuncs()
    os._exit(_flushed(status))


def _flushed(status: int) -> int:
    """Write what is still in memory; the exit status that is right then."""
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        return _READER_GONE  # As of 'head', which has seen enough.
    except OSError as error:
        sys.stderr.write(f"error: cannot write what was found out: {error.strerror}\n")
        status = _UNWRITTEN
    sys.stderr.flush()
    return status
