"""Ctrl-C: the first ends a command, which puts away what it has; the next wait for that; the fourth ends at once.

Python raises each of them wherever it is, so an impatient second one would cut off the putting away and end in a
traceback.
"""

from __future__ import annotations

import os
import signal
import sys
from types import FrameType

INTERRUPTED = 130
"""Exit status of a command that Ctrl-C has ended, as of a shell."""
_PATIENCE = 3
"""After so many the program is left at once; what is committed by then stays so, as with any other kill."""


class Interrupts:
    """Counts the interrupts of this process once it is installed."""

    def __init__(self) -> None:
        self.count = 0

    def install(self) -> None:
        """Answer SIGINT from now on, in the main thread alone. A signal that is ignored stays so, as for nohup."""
        if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            signal.signal(signal.SIGINT, self._answer)

    def end(self) -> None:
        """Ignore further ones while Python takes itself apart, if there was one."""
        if self.count:
            signal.signal(signal.SIGINT, signal.SIG_IGN)

    def _answer(self, number: int, frame: FrameType | None) -> None:
        self.count += 1
        if self.count > _PATIENCE:
            os._exit(INTERRUPTED)
        if self.count == 2:
            sys.stderr.write("still putting away what is there\n")
        if self.count > 1:
            return
        raise KeyboardInterrupt


INTERRUPTS = Interrupts()
"""Of this process."""
