"""A forked child that is killed just before one of its changes to the file system, or at some moment.

The kernel stops every thread of the child, and of the processes that it starts, at calls that change files, and asks
this process whether they may go on. So each of them is a point to kill at, those of libraries in other languages too,
and it is told when the last process of the family has ended. This process must have opened nothing that does not
survive a fork: no dataset, no simulator.
"""

from __future__ import annotations

import atexit
import ctypes
import fcntl
import os
import platform
import select
import signal
import socket
import struct
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass

EXACT = sys.platform == "linux" and platform.machine() == "x86_64"
"""Whether calls can be stopped at; elsewhere children are killed at random moments alone."""

_CHANGES = {
    **{"fsync": 74, "fdatasync": 75, "truncate": 76, "ftruncate": 77, "rename": 82, "mkdir": 83, "rmdir": 84},
    **{"creat": 85, "link": 86, "unlink": 87, "symlink": 88, "mkdirat": 258, "unlinkat": 263, "renameat": 264},
    **{"linkat": 265, "symlinkat": 266, "syncfs": 306, "renameat2": 316, "copy_file_range": 326},
}
_OPENAT, _WRITES = 257, (1, 18)
_TO_WRITE = os.O_WRONLY | os.O_RDWR | os.O_CREAT
_WAKING = 8
"""Bytes that threads write to wake each other."""

_LOAD, _EQUAL, _ANY_BIT, _RETURN = 0x20, 0x15, 0x45, 0x06
_ASK, _ALLOW = 0x7FC00000, 0x7FFF0000
_RECEIVE, _ANSWER, _GO_ON = 0xC0502100, 0xC0182101, 1
_SECCOMP, _NO_NEW_PRIVILEGES, _BECOME_REAPER = 317, 38, 36
_OUTLIVED_S = 10.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Fate:
    """What became of a child."""

    status: int | None
    """Its exit status; None when it was killed."""
    points: int
    """How many changes to files it and its children were stopped at."""
    elapsed_s: float
    outlived: bool
    """Whether something that it started went on for 10 s after it."""


def run_killed(work: Callable[[], int], *, point: int | None = None, after_s: float | None = None) -> Fate:
    """Run ``work`` in a child, and kill it before its change of that number, or after a time, if it gets there."""
    return _run(work, _Blow(point=point, after_s=after_s))


def run_in_child(work: Callable[[], int]) -> Fate:
    """Run ``work`` in a child that nobody stops."""
    return _run(work, None)


def run_interrupted(work: Callable[[], int], *, point: int, times: int = 1) -> Fate:
    """As :func:`run_killed`, with Ctrl-C, as a terminal sends it, before that change and each of the next ones."""
    return _run(work, _Blow(point=point, interrupts=times))


@dataclass(slots=True)
class _Blow:
    """What a child is dealt, and when."""

    point: int | None = None
    after_s: float | None = None
    interrupts: int = 0
    """How often Ctrl-C is pressed, at one point each; 0 to kill."""

    def falls_at(self, points: int) -> bool:
        """Whether the child is dealt it at this point."""
        return self.point is not None and self.point <= points < self.point + max(1, self.interrupts)

    def deal(self, pid: int) -> None:
        """Send the signal."""
        if self.interrupts:
            os.killpg(pid, signal.SIGINT)
        else:
            os.kill(pid, signal.SIGKILL)


def _run(work: Callable[[], int], blow: _Blow | None) -> Fate:
    exact = EXACT and blow is not None
    ours, theirs = socket.socketpair()
    began = time.monotonic()
    pid = os.fork()
    if pid == 0:
        ours.close()
        os.setpgid(0, 0)
        if exact:
            _hand_over_filter(theirs)
        theirs.close()
        status = work()
        # What Python does at its end, but for taking apart its modules, which takes longer than many a command.
        atexit._run_exitfuncs()
        os._exit(status)
    theirs.close()
    listener = None
    if exact:
        _, descriptors, _, _ = socket.recv_fds(ours, 1, 1)
        listener = next(iter(descriptors), None)
    try:
        return _watch(pid, listener, began, blow or _Blow())
    finally:
        ours.close()
        if listener is not None:
            os.close(listener)


def _watch(pid: int, listener: int | None, began: float, blow: _Blow) -> Fate:
    """Answer the family's questions until all of it has ended."""
    ctypes.CDLL(None).prctl(_BECOME_REAPER, 1, 0, 0, 0)
    child = os.pidfd_open(pid)
    poll, poll_gone = select.poll(), select.poll()
    for one in (poll, poll_gone):
        one.register(child, select.POLLIN)
    if listener is not None:
        poll.register(listener, select.POLLIN)
    points, status, ended_at, outlived, after_s = 0, 0, None, False, blow.after_s
    try:
        while True:
            now = time.monotonic()
            if ended_at is None and after_s is not None and now - began >= after_s:
                blow.deal(pid)
                after_s = None
            if ended_at is not None and now - ended_at > _OUTLIVED_S:
                outlived = True
                break
            limits = [1.0] + ([] if after_s is None else [max(0.0, began + after_s - now)])
            ready = dict(poll.poll(min(limits) * 1000))
            if listener is not None and listener in ready:
                if not ready[listener] & select.POLLIN:
                    poll.unregister(listener)  # Nobody is left to ask.
                    listener = None
                else:
                    points += 1
                    if ended_at is None and blow.falls_at(points):
                        blow.deal(pid)
                        if not blow.interrupts:
                            # Told to go on before it is gone, it would.
                            poll_gone.poll()
                            ready[child] = select.POLLIN
                    _answer(listener)
            if child in ready and ended_at is None:
                status = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
                ended_at = time.monotonic()
                poll.unregister(child)
            if ended_at is not None:
                _reap(pid)
                if listener is None:
                    break
    finally:
        os.close(child)
    ended_at = ended_at or time.monotonic()
    killed = status == -signal.SIGKILL
    return Fate(status=None if killed else status, points=points, elapsed_s=ended_at - began, outlived=outlived)


def _reap(group: int) -> None:
    """Take note of the end of orphans.

    Else they are the init process's and may lie there unnoticed for a minute, in which the kernel counts them as going
    on.
    """
    try:
        while os.waitpid(-group, os.WNOHANG)[0]:
            pass
    except ChildProcessError:
        pass


def _answer(listener: int) -> None:
    question = bytearray(80)
    try:
        fcntl.ioctl(listener, _RECEIVE, question)
        (identity,) = struct.unpack_from("Q", question)
        fcntl.ioctl(listener, _ANSWER, struct.pack("QqiI", identity, 0, 0, _GO_ON))
    except OSError:
        pass  # Who asked has been killed.


def _hand_over_filter(to: socket.socket) -> None:
    """In the child: be stopped from now on, and give away where that is told; nothing where it is not allowed."""
    try:
        listener = _install_filter()
    except OSError:
        to.send(b"x")
        return
    socket.send_fds(to, [b"x"], [listener])
    os.close(listener)


def _install_filter() -> int:
    """Have the kernel ask about changes to files; the descriptor at which it does."""
    plain = list(_CHANGES.values())
    ask, allow = len(plain) + 9, len(plain) + 10

    def jump(at: int, target: int) -> int:
        return target - at - 1

    program = [(_LOAD, 0, 0, 0)]
    for number in plain:
        at = len(program)
        program.append((_EQUAL, jump(at, ask), 0, number))
    opened, written = len(plain) + 5, len(plain) + 7
    for number, target in ((_OPENAT, opened), *((one, written) for one in _WRITES)):
        at = len(program)
        program.append((_EQUAL, jump(at, target), 0, number))
    program.append((_RETURN, 0, 0, _ALLOW))
    program.append((_LOAD, 0, 0, 32))
    program.append((_ANY_BIT, jump(len(program), ask), jump(len(program), allow), _TO_WRITE))
    program.append((_LOAD, 0, 0, 32))
    program.append((_EQUAL, jump(len(program), allow), jump(len(program), ask), _WAKING))
    program += [(_RETURN, 0, 0, _ASK), (_RETURN, 0, 0, _ALLOW)]
    assert len(program) == allow + 1
    code = b"".join(struct.pack("HBBI", *one) for one in program)
    libc = ctypes.CDLL(None, use_errno=True)
    buffer = ctypes.create_string_buffer(code)
    described = struct.pack("HxxxxxxQ", len(program), ctypes.addressof(buffer))
    libc.prctl(_NO_NEW_PRIVILEGES, 1, 0, 0, 0)
    listener = libc.syscall(_SECCOMP, 1, 1 << 3, ctypes.create_string_buffer(described))
    if listener < 0:
        raise OSError(ctypes.get_errno(), "the kernel does not stop at calls here")
    return int(listener)
