"""What a failure says decides whose fault it is, in the words of the system, of Python and of Icechunk."""

from __future__ import annotations

import errno
import os

import icechunk
import pytest

from handsight.datasets import CorruptDataError, DatasetError, StorageError
from handsight.datasets.machine import REMEDIES, cause_and_remedy, machine_blamed, of_the_machine, shortage

LISTED = "object store error Generic LocalFileSystem error: Unable to walk dir: IO error for operation on /d/refs: "


@pytest.mark.parametrize("number", REMEDIES)
def test_what_the_system_refuses_is_named_in_its_words(number: int) -> None:
    trouble = of_the_machine("grasps.hdf5 cannot be read", OSError(number, "(unable to open file)"))
    assert isinstance(trouble, StorageError)
    assert str(trouble).startswith(
        f"grasps.hdf5 cannot be read: {os.strerror(number)}; nothing is known of its content"
    )
    assert str(trouble).endswith(REMEDIES[number])


@pytest.mark.parametrize(
    ("error", "cause"),
    [
        (icechunk.IcechunkError(f"{LISTED}Too many open files (os error 24)"), "Too many open files"),
        (icechunk.IcechunkError("x object store error\n`-> Connection refused (os error 111)"), "Connection refused"),
        (icechunk.IcechunkError("error getting object from object store dispatch failure"), "does not answer"),
        (icechunk.IcechunkError("service error: AccessDenied"), "refuses access"),
        (RuntimeError("can't start new thread"), "no thread can be started"),
        (RuntimeError("Zstd decompression error: Allocation error : not enough memory"), "not enough memory"),
        (MemoryError(), "not enough memory"),
    ],
)
def test_what_libraries_say_of_the_machine_is_understood(error: Exception, cause: str) -> None:
    said = cause_and_remedy(error)
    assert said is not None
    assert cause in said[0]


@pytest.mark.parametrize(
    "error",
    [
        icechunk.IcechunkError("Object at location /d/chunks/A not found: No such file or directory (os error 2)"),
        icechunk.IcechunkError("x session error: I/O error\n|-> Unknown frame descriptor"),
        OSError(errno.ENOENT, "No such file or directory"),
        OSError("Unable to open file (truncated file)"),
        ValueError("Stored and computed checksum do not match"),
        ValueError("cell 'connection timed out' is no number"),
        RuntimeError("error during blosc decompression: -1"),
        CorruptDataError("was judged before: can't start new thread"),
    ],
)
def test_what_was_read_and_is_wrong_is_none_of_the_machines(error: Exception) -> None:
    assert of_the_machine("it cannot be read", error) is None


def test_nothing_is_short_on_a_machine_that_runs_tests() -> None:
    assert shortage() is None


def test_only_errors_of_the_machine_change_on_their_way() -> None:
    with (
        pytest.raises(DatasetError, match="it cannot be read: Too many open files"),
        machine_blamed("it cannot be read"),
    ):
        raise OSError(errno.EMFILE, "")
    with pytest.raises(ValueError, match="as it was"), machine_blamed("it cannot be read"):
        raise ValueError("as it was")
