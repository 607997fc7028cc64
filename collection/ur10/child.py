"""A device's client in a process of its own, which may crash, hang and be killed without harm to anybody else.

The vendors' C++ clients do all three when a connection is lost. So each lives in a spawned child that answers one
request at a time over a pipe. A request that is not answered in time ends the child with SIGKILL; the next one starts
another. Answers carry the number of their request, so that a late one is never taken for another's. A device that is
long at something may say that it still is: then one that hangs is told from one that works.
"""

from __future__ import annotations

import contextlib
import ctypes
import math
import multiprocessing
import os
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

from handsight.collection.errors import DeviceError, DeviceLostError, PoseRefusedError, RobotStoppedError

_SPAWN = multiprocessing.get_context("spawn")
_PR_SET_PDEATHSIG = 1
LEAVE_TIMEOUT_S = 1.0
"""How long a child whose device is closed may take to end."""
TELL_EVERY_S = 0.25
"""How often a device that works says so, at most."""
_KNOWN = {kind.__name__: kind for kind in (DeviceError, DeviceLostError, PoseRefusedError, RobotStoppedError)}


@dataclass(frozen=True, slots=True)
class _Request:
    number: int
    method: str
    arguments: tuple[Any, ...]


class SupervisedChild:
    """One device, opened in a child by ``open_device`` when something is asked of it.

    ``open_device`` must survive pickling; what it returns is asked by method name, and closed with the child. Where it
    has an attribute ``still_at_it`` that gets a function to call now and then in what takes long.
    """

    def __init__(
        self, name: str, open_device: Callable[[], Any], *, open_timeout_s: float, log: Path | None = None
    ) -> None:
        """Nothing is started yet.

        Args:
            name: What messages call the device.
            open_device: Opens the client, in the child.
            open_timeout_s: How long that may take.
            log: File that gets what the vendor's library prints; None drops it.
        """
        self.name = name
        self.respawns = 0
        """How often a child was started after the first."""
        self._open_device = open_device
        self._open_timeout_s = open_timeout_s
        self._log = log
        self._process: BaseProcess | None = None
        self._pipe: Connection | None = None
        self._number = 0
        self._started = False

    @property
    def pid(self) -> int | None:
        """Of the child; None where there is none."""
        return None if self._process is None else self._process.pid

    @property
    def alive(self) -> bool:
        """Whether a child is there to be asked."""
        return self._process is not None and self._process.is_alive()

    def ask(self, method: str, *arguments: Any, timeout_s: float, silence_s: float = math.inf) -> Any:
        """Call a method of the device and return what it returns.

        Args:
            method: Its name.
            arguments: What it is called with.
            timeout_s: How long it may take.
            silence_s: How long it may say nothing, not even that it is still at it.

        Raises:
            DeviceLostError: The child died or did not answer in time; it is gone now.
            DeviceError: What the device raised; the child lives on.
        """
        self.start()
        return self._ask(method, arguments, timeout_s, silence_s)

    def start(self) -> None:
        """Start the child and open the device where that is to be done.

        Raises:
            DeviceError: The device cannot be opened; no child is left.
        """
        if self.alive:
            return
        self.kill()
        self.respawns += self._started
        self._started = True
        ours, theirs = _SPAWN.Pipe()
        process = _SPAWN.Process(
            target=_serve,
            args=(theirs, self._open_device, self._log, os.getpid()),
            name=f"handsight-{self.name}",
            # A process that ends waits for its children, unless they are ended with it.
            daemon=True,
        )
        process.start()
        theirs.close()
        self._process, self._pipe = process, ours
        try:
            self._ask("", (), self._open_timeout_s)
        except DeviceError:
            self.kill()
            raise

    def kill(self) -> None:
        """End the child at once, whatever it does."""
        if self._pipe is not None:
            self._pipe.close()
            self._pipe = None
        if self._process is not None:
            self._process.kill()
            self._process.join()
            self._process.close()
            self._process = None

    def close(self, *, timeout_s: float = 3.0) -> None:
        """Have the child close its device and end; kill it where it does not."""
        if self.alive:
            with contextlib.suppress(DeviceError):
                self._ask("close", (), timeout_s)
            if self._process is not None:
                self._process.join(LEAVE_TIMEOUT_S)
        self.kill()

    def _ask(self, method: str, arguments: tuple[Any, ...], timeout_s: float, silence_s: float = math.inf) -> Any:
        if self._pipe is None:
            raise DeviceLostError(f"{self.name}: there is no child to ask")
        self._number += 1
        until = time.monotonic() + timeout_s
        try:
            self._pipe.send(_Request(self._number, method, arguments))
            good, answer = self._answer(self._pipe, method or "opening", until, silence_s)
        except (EOFError, OSError) as error:
            code = self._exit_code()
            self.kill()
            raise DeviceLostError(f"{self.name}: its process ended with status {code} over {method!r}") from error
        if good:
            return answer
        kind, message = answer
        raise _KNOWN.get(kind, DeviceError)(f"{self.name}: {message}")

    def _answer(self, pipe: Connection, what: str, until: float, silence_s: float) -> tuple[bool, Any]:
        """The answer to the last request, and whether it is one and no error."""
        heard = begun = time.monotonic()
        while True:
            last = min(until, heard + silence_s)
            if not pipe.poll(max(last - time.monotonic(), 0.0)):
                self.kill()
                seconds = time.monotonic() - begun
                how = "took longer than" if last == until else f"said nothing for {silence_s:g} s, after"
                raise DeviceLostError(f"{self.name}: {what} {how} {seconds:.3g} s; its process was ended")
            number, good, answer = pipe.recv()
            if number == self._number:
                if good is not None:
                    return good, answer
                heard = time.monotonic()

    def _exit_code(self) -> int | None:
        if self._process is None:
            return None
        self._process.join(1.0)
        return self._process.exitcode


def _serve(pipe: Connection, open_device: Callable[[], Any], log: Path | None, parent: int) -> None:
    """The child: open the device, answer until the pipe closes."""
    _end_with_parent(parent)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's business; the arm is stopped by it.
    _silence(log)
    device: Any = None
    told_s, number = 0.0, 0

    def still_at_it() -> None:
        nonlocal told_s
        if time.monotonic() - told_s > TELL_EVERY_S:
            told_s = time.monotonic()
            pipe.send((number, None, None))

    while True:
        try:
            request: _Request = pipe.recv()
        except (EOFError, OSError):
            break
        number = request.number
        try:
            if request.method == "":
                device = open_device()
                if hasattr(device, "still_at_it"):
                    device.still_at_it = still_at_it
                answer: Any = None
            else:
                answer = getattr(device, request.method)(*request.arguments)
            pipe.send((request.number, True, answer))
        except Exception as error:
            pipe.send((request.number, False, (type(error).__name__, str(error) or repr(error))))
        if request.method == "close":
            break
    # Destructors of the clients wait for threads, and some crash: nothing of theirs is needed any more.
    os._exit(0)


def _silence(log: Path | None) -> None:
    """Send what C++ prints to a file, or nowhere."""
    target = os.open(log or os.devnull, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    sys.stdout.flush()
    os.dup2(target, 1)
    os.dup2(target, 2)
    os.close(target)


def _end_with_parent(parent: int) -> None:
    """Have the kernel end this process when its parent is gone, even killed."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:
            os._exit(0)
