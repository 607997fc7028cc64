"""Has an HDF5 file read in a process of its own first, because damage can make the HDF5 library hang or crash.

A single flipped bit makes HDF5 2.0 go round in circles or touch memory that is not its own; no handler of Python's sees
either.
"""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

from handsight.datasets.errors import InterchangeError
from handsight.datasets.machine import of_the_machine

_START_S = 3
"""Processor time to start Python and read a small file, many times over."""
_BYTES_A_SECOND = 2 * 10**6
"""A fraction of what is read in a second of processor time."""
_PROGRAM = Path(__file__).with_name("hdf5_walk.py")
_LONGEST_WAITS = 20
"""How many times its processor time a process may take on a busy machine with a slow disk."""


def refuse_unreadable(path: Path) -> None:
    """Refuse a file that the HDF5 library cannot walk through alive. What it says of it is for the reader to find.

    Raises:
        InterchangeError: The library hangs or crashes.
        StorageError: No process can be started to find out.
    """
    limit_s = _START_S + path.stat().st_size // _BYTES_A_SECOND
    words = [sys.executable, "-P", str(_PROGRAM), str(path.resolve()), str(limit_s)]
    nothing = subprocess.DEVNULL
    try:
        done = subprocess.run(
            words, timeout=limit_s * _LONGEST_WAITS, check=False, stdin=nothing, stdout=nothing, stderr=nothing
        )
        ended = done.returncode
    except subprocess.TimeoutExpired:
        ended = -signal.SIGXCPU
    except OSError as error:
        if trouble := of_the_machine(f"no process can be started to look at {path}", error):
            raise trouble from error
        raise
    if ended < 0:
        what = "does not come to an end with it" if ended == -signal.SIGXCPU else f"crashes on it (signal {-ended})"
        raise InterchangeError(f"{path} is damaged: the HDF5 library {what}; take an undamaged copy")
