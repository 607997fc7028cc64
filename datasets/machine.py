"""Whose fault a failed read is: that of the machine, which could not read, or of bytes that were read and are wrong.

The two call for opposite acts: a descriptor limit is raised and nothing is lost, damage is replaced from a copy. So
nothing is called damaged while the machine lacks what a read takes. Operating system, Python and Icechunk each say that
in their own way, and libraries that run short of memory or threads often say only that they failed; therefore the
machine itself is asked too, before anything is called damaged.
"""

from __future__ import annotations

import errno
import mmap
import os
import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from handsight.datasets.errors import DatasetError, StorageError

_AGAIN = "then try again"
_DISK = "see the kernel's log (dmesg), and copy what can still be read to another disk"
_NETWORK = f"see that the file server or bucket is within reach, {_AGAIN}"
_RIGHTS = f"look at owner and permissions (ls -l), {_AGAIN}"
_ROOM = f"free some room there, {_AGAIN}"
_MEMORY = f"free some memory or raise its limit (ulimit -v), or use fewer processes, {_AGAIN}"
_FILES = f"close programs or raise the limit (ulimit -n), {_AGAIN}"
_THREADS = f"end some processes or raise the limit (ulimit -u), {_AGAIN}"

REMEDIES = {
    errno.EACCES: _RIGHTS,
    errno.EPERM: _RIGHTS,
    errno.EROFS: "mount it for writing, or work on a copy elsewhere",
    errno.EMFILE: _FILES,
    errno.ENFILE: _FILES,
    errno.ENOMEM: _MEMORY,
    errno.EAGAIN: _THREADS,
    errno.ENOSPC: _ROOM,
    errno.EDQUOT: _ROOM,
    errno.EIO: _DISK,
    errno.ENXIO: _DISK,
    errno.ENODEV: _DISK,
    errno.EREMOTEIO: _NETWORK,
    errno.ESTALE: _NETWORK,
    errno.ETIMEDOUT: _NETWORK,
    errno.EHOSTDOWN: _NETWORK,
    errno.EHOSTUNREACH: _NETWORK,
    errno.ENETDOWN: _NETWORK,
    errno.ENETUNREACH: _NETWORK,
    errno.ENOTCONN: _NETWORK,
    errno.ECONNREFUSED: _NETWORK,
    errno.ECONNRESET: _NETWORK,
    errno.ECONNABORTED: _NETWORK,
    errno.EPIPE: _NETWORK,
}
"""What to do, by the numbers of the system with which it refuses to read or write."""

_NUMBER = re.compile(r"\(os error (\d+)\)")
"""How Rust ends what the system said; Icechunk has one class for all errors."""

_WORDS = (
    (re.compile(r"can't start new thread|can't spawn \w+ thread"), "no thread can be started", _THREADS),
    (
        re.compile(r"not enough memory|cannot allocate memory|memory allocation", re.IGNORECASE),
        "there is not enough memory",
        _MEMORY,
    ),
    (
        re.compile(r"dispatch failure|timed? ?out|connection (?:refused|reset|closed)|dns error", re.IGNORECASE),
        "the store does not answer",
        _NETWORK,
    ),
    (
        re.compile(r"access ?denied|forbidden|invalidaccesskeyid|signaturedoesnotmatch|expiredtoken", re.IGNORECASE),
        "the store refuses access",
        f"look at the credentials and at the bucket's policy, {_AGAIN}",
    ),
)
"""What libraries say that have no number for it."""

_OF_VALUES = (ArithmeticError, AssertionError, AttributeError, LookupError, TypeError, ValueError)
"""Never of the machine; their words may be somebody's own, out of a table or a file's name."""

_READ_BYTES = 1 << 26
"""A few pictures and what their decoding takes."""


def of_the_machine(what: str, error: BaseException) -> StorageError | None:
    """The error to raise where the machine could not read or write; None where something was read and is wrong.

    Args:
        what: What could not be done, such as ``grasps.hdf5 cannot be read``.
        error: Whatever a library raised. An error of this room has been judged before, so nothing is said of it.
    """
    if isinstance(error, DatasetError):
        return None
    said = cause_and_remedy(error)
    if said is None:
        return None
    cause, remedy = said
    return StorageError(f"{what}: {cause}; nothing is known of its content: {remedy}")


def cause_and_remedy(error: BaseException) -> tuple[str, str] | None:
    """What the machine lacks, and what to do; None where an error is none of the machine's."""
    return said_by(error) or shortage()


@contextmanager
def machine_blamed(what: str) -> Iterator[None]:
    """Let errors of the machine leave the block as errors of this room, and all others as they are.

    Raises:
        StorageError: The machine could not read or write.
    """
    try:
        yield
    except Exception as error:
        if trouble := of_the_machine(what, error):
            raise trouble from error
        raise


def shortage() -> tuple[str, str] | None:
    """What the machine lacks of that which any read takes, and what to do; None where it has it all."""
    try:
        os.close(os.open(os.devnull, os.O_RDONLY))
        mmap.mmap(-1, _READ_BYTES).close()
        thread = threading.Thread(target=_nothing)
        thread.start()
        thread.join()
    except (OSError, MemoryError, RuntimeError) as error:
        return said_by(error)
    return None


def said_by(error: BaseException) -> tuple[str, str] | None:
    """As :func:`cause_and_remedy`, by what the error says alone, without a look at the machine."""
    if isinstance(error, MemoryError):
        return "there is not enough memory", _MEMORY
    if isinstance(error, _OF_VALUES):
        return None
    # Libraries put their own words into strerror.
    numbers = [error.errno] if isinstance(error, OSError) else [int(one) for one in _NUMBER.findall(str(error))]
    known = [number for number in numbers if number is not None]
    for number in known:
        if number in REMEDIES:
            return os.strerror(number), REMEDIES[number]
    if known:
        return None
    text = str(error)
    return next(((cause, remedy) for pattern, cause, remedy in _WORDS if pattern.search(text)), None)


def _nothing() -> None:
    pass
