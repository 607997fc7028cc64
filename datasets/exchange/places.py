"""Where exports and imports may read and write, and whether a dataset is still where it was."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from handsight.datasets.address import Location, S3Prefix
from handsight.datasets.errors import InterchangeError, StorageError
from handsight.datasets.writable import folder_fault, link_fault

_STORE_FOLDERS = frozenset({"chunks", "manifests", "snapshots", "transactions", ".handsight"})
"""What appears where a dataset was, if somebody moves it while it is written to."""


def refuse_target(target: Path) -> None:
    """Refuse a place where nothing new can be made.

    Raises:
        InterchangeError: Something is there, or it is inside a dataset.
        StorageError: Nothing can be written there.
    """
    if (fault := link_fault(target)) is not None:
        raise InterchangeError(f"{fault}: choose another path, or remove the link")
    if target.exists():
        raise InterchangeError(f"there is something at {target} already: choose another path, or move it away")
    for folder in target.resolve().parents:
        if (folder / "refs").is_dir() and (folder / "snapshots").is_dir():
            raise InterchangeError(f"{target} is inside the dataset {folder}: choose a path outside of it")
    if (fault := folder_fault(target)) is not None:
        raise StorageError(f"cannot write {target}: {fault}; mend that, or choose another place")


def refuse_source(source: Path) -> None:
    """Refuse what cannot be any format.

    Raises:
        InterchangeError: Nothing is there, or what macOS leaves beside a file.
    """
    if (fault := link_fault(source)) is not None:
        raise InterchangeError(f"{fault}: import what it was meant to name")
    if not source.exists():
        raise InterchangeError(f"there is nothing at {source} to import: check the path")
    if source.name.startswith("._") and source.is_file():
        raise InterchangeError(
            f"{source} is what macOS keeps beside a file on other disks, expected the file itself: import "
            f"{source.with_name(source.name[2:])}"
        )


@contextmanager
def staying_in_place(location: Location) -> Iterator[None]:
    """Name the reason where the block fails because somebody has moved the dataset meanwhile.

    Raises:
        StorageError: The dataset is not at its location any more.
    """
    if isinstance(location, S3Prefix) or not location.exists():
        yield
        return
    before = location.stat()
    try:
        yield
    except (OSError, RuntimeError, ValueError, LookupError) as error:
        if location.exists() and os.path.samestat(location.stat(), before):
            raise
        _remove_remains(location)
        raise StorageError(
            f"{location} was moved or renamed while it was written to: nothing was added; try again with its new name"
        ) from error


def _remove_remains(location: Path) -> None:
    """Remove the folders that the store has made anew where the dataset was; nothing of anybody else's."""
    if location.is_dir() and {path.name for path in location.iterdir()} <= _STORE_FOLDERS:
        shutil.rmtree(location, ignore_errors=True)
