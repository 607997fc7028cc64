"""Files and folders that are there whole or not at all: written under another name beside their own, then renamed.

What a killed process was writing stays behind under a name that begins with a dot and is never read. Whoever writes
beside it next deletes it: a lock beside it (held.py) tells that nobody writes it any more.
"""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from handsight.datasets.held import HeldFile, clear_abandoned, lock_of

_UNFINISHED = ".unfinished-"


@contextmanager
def atomic_file(path: Path, *, durable: bool = False) -> Iterator[Path]:
    """A path beside ``path`` for the block to write a file to, which replaces ``path`` at the end.

    The name is of this call alone and ends as that of ``path`` does, for writers that go by it. When the block fails,
    nothing is left behind and ``path`` is as it was.

    Args:
        path: The file to be; its folder exists.
        durable: Whether a power cut at any moment leaves the old content or the new one, the latter once this is done.
            Without it a power cut soon after may leave an empty file.

    Raises:
        OSError: The file cannot be renamed or synced.
    """
    with _unfinished(path.parent, path.stem, path.suffix) as unfinished:
        try:
            yield unfinished
            if durable:
                sync(unfinished)
            unfinished.replace(path)
            if durable:
                sync(path.parent)
        finally:
            unfinished.unlink(missing_ok=True)


def write_text(path: Path, text: str, *, durable: bool = False) -> None:
    """Write a text file as UTF-8, whole or not at all; see :func:`atomic_file`.

    Raises:
        OSError: It cannot be written.
    """
    with atomic_file(path, durable=durable) as unfinished:
        unfinished.write_text(text, encoding="utf-8")


@contextmanager
def atomic_folder(path: Path, *, beside: Path | None = None, durable: bool = False) -> Iterator[Path]:
    """A path for the block to make a folder at, which becomes ``path`` at the end, unless something is there by then.

    An empty folder at ``path`` is replaced. When the block fails, nothing is left behind. A file may be made as well,
    which would replace another.

    Args:
        path: The folder to be.
        beside: Existing folder of the same file system in which it is made; that of ``path`` unless another is given.
        durable: Whether the names in the folder, and its own, have reached the disk once this is done. What lies in its
            files and in the folders below is for the block to sync.

    Raises:
        OSError: The folder cannot be renamed or synced, for instance because another process was first.
    """
    parent = path.parent if beside is None else beside
    with _unfinished(parent, path.name) as temporary:
        temporary.mkdir(mode=0o700)
        try:
            unfinished = temporary / path.name
            yield unfinished
            if durable:
                sync(unfinished)
            unfinished.rename(path)
            if durable:
                sync(path.parent)
        finally:
            shutil.rmtree(temporary)


def clear_unfinished(folder: Path) -> None:
    """Delete everything that killed processes were writing in a folder, and leave alone what others write now."""
    clear_abandoned(folder, ".", containing=_UNFINISHED)


def is_unfinished(path: Path) -> bool:
    """Whether a name is that of something on its way to its place, or of the lock beside it."""
    return path.name.startswith(".") and _UNFINISHED in path.name


@contextmanager
def _unfinished(parent: Path, stem: str, suffix: str = "") -> Iterator[Path]:
    """A name that is held for this call, after what killed processes left in the folder has been deleted."""
    clear_unfinished(parent)
    unfinished = parent / f".{stem}{_UNFINISHED}{secrets.token_hex(4)}{suffix}"
    lock = HeldFile(lock_of(unfinished))
    try:
        yield unfinished
    finally:
        lock.release()


def sync(path: Path) -> None:
    """Wait until a file's content, or the names in a folder, are on the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
