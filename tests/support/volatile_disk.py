"""What a power cut can leave of a folder: a model of a disk that promises no more than POSIX does.

Only what was synced is certain. Of everything else any part may have reached the disk, in any order: a folder may show
its old entries or its new ones, each on its own, and a file that was not synced may be whole, cut short or empty under
the name that it has.
"""

from __future__ import annotations

import os
import shutil
import stat
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from handsight.datasets.store import icechunk_engine

State = tuple[int, int, int]
"""A file at some time: its inode, its last change, its size."""
Entry = State | int
"""What a name in a folder leads to: a file, or a folder by its inode."""


class VolatileDisk:
    """Follows the syncs of this process that concern a folder."""

    def __init__(self, folder: Path) -> None:
        """A disk on which everything of the folder is durable so far."""
        self.folder = folder
        self.sync_everything()

    def follow(self, monkeypatch: pytest.MonkeyPatch, at_sync: Callable[[], None]) -> None:
        """From now on learn of every sync of this process; ``at_sync`` is called just before each."""
        sync_one, sync_all = os.fsync, icechunk_engine.sync_file_system

        def fsync(descriptor: int) -> None:
            at_sync()
            sync_one(descriptor)
            self.sync(descriptor)

        def sync_file_system(path: Path) -> None:
            at_sync()
            sync_all(path)
            self.sync_everything()

        monkeypatch.setattr(os, "fsync", fsync)
        users = [one for name, one in sys.modules.items() if name.startswith("handsight.datasets")]
        for module in users:
            if getattr(module, "sync_file_system", None) is sync_all:
                monkeypatch.setattr(module, "sync_file_system", sync_file_system)

    def sync_everything(self) -> None:
        """As ``syncfs`` does."""
        self._durable = {_state(path): path.read_bytes() for path in _files(self.folder)}
        self._entries = {inode: _listing(path) for inode, path in _folders(self.folder).items()}

    def sync(self, descriptor: int) -> None:
        """As ``fsync`` does: of a file its content, of a folder its entries."""
        found = os.fstat(descriptor)
        if stat.S_ISDIR(found.st_mode):
            folder = _folders(self.folder).get(found.st_ino)
            if folder is not None:
                self._entries[found.st_ino] = _listing(folder)
        else:
            for path in _files(self.folder):
                if path.stat().st_ino == found.st_ino:
                    self._durable[_state(path)] = path.read_bytes()

    def cut(self, target: Path, rng: np.random.Generator) -> None:
        """Write to ``target`` what a power cut could leave now."""
        shutil.rmtree(target, ignore_errors=True)
        files = {_state(path): path for path in _files(self.folder)}
        self._rebuild(self.folder.stat().st_ino, target, files, _folders(self.folder), rng)

    def _rebuild(
        self, inode: int, target: Path, files: dict[State, Path], folders: dict[int, Path], rng: np.random.Generator
    ) -> None:
        target.mkdir(parents=True)
        durable = self._entries.get(inode, {})
        now = _listing(folders[inode]) if inode in folders else {}
        for name in sorted({*durable, *now}):
            entry = (durable if rng.random() < 0.5 else now).get(name)
            if isinstance(entry, int):
                self._rebuild(entry, target / name, files, folders, rng)
            elif entry is not None:
                (target / name).write_bytes(self._content(entry, files, rng))

    def _content(self, state: State, files: dict[State, Path], rng: np.random.Generator) -> bytes:
        if state in self._durable:
            return self._durable[state]
        whole = files[state].read_bytes() if state in files else b""
        kept = (0, int(rng.integers(len(whole) + 1)), len(whole))
        return whole[: kept[rng.integers(len(kept))]]


def _files(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*") if path.is_file()]


def _folders(folder: Path) -> dict[int, Path]:
    return {path.stat().st_ino: path for path in (folder, *folder.rglob("*")) if path.is_dir()}


def _listing(folder: Path) -> dict[str, Entry]:
    return {path.name: path.stat().st_ino if path.is_dir() else _state(path) for path in folder.iterdir()}


def _state(path: Path) -> State:
    found = path.stat()
    return found.st_ino, found.st_mtime_ns, found.st_size
