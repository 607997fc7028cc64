"""Branches and releases on a local disk, written so that a power cut leaves the old target or the new one, whole.

Icechunk keeps a ref in a file that it renames into place without syncing it first. Some file systems let the rename
reach the disk before the content, and after a power cut the file is empty: no version can be found any more. In an
object store a write is durable and whole once it is acknowledged, so there Icechunk's own calls serve.

The caller holds the commit lock; nothing else keeps two processes from moving the same branch.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

import icechunk

from handsight.datasets.address import DEFAULT_REF, Location, S3Prefix
from handsight.datasets.atomic import atomic_file, atomic_folder, sync
from handsight.datasets.errors import RefNameError, StorageError
from handsight.datasets.store.files import names_in, stored_files, write_object
from handsight.datasets.store.releases import LEDGER_BRANCH

_FILE = "ref.json"
_TOMBSTONE = "ref.json.deleted"

Kind = Literal["branch", "tag"]


def ref_names(path: Location) -> tuple[list[str], list[str]]:
    """Names of the tags and of the branches of a dataset, each sorted.

    Icechunk would ask a bucket for two files of every tag to list either.

    Raises:
        StorageError: The disk or bucket cannot be read.
    """
    files = stored_files(path, "refs")
    found: dict[str, list[str]] = {"tag": [], "branch": []}
    for file in files:
        folder, _, name = file.rpartition("/")
        kind, _, ref = folder.partition(".")
        if name == _FILE and kind in found and f"{folder}/{_TOMBSTONE}" not in files:
            found[kind].append(ref)
    return sorted(found["tag"]), sorted(found["branch"])


def move_branch(path: Path, name: str, snapshot_id: str) -> None:
    """Let a branch of a local dataset point to a snapshot that is on the disk; durable when this returns.

    Raises:
        StorageError: The disk is full or not writable.
    """
    folder = path / "refs" / f"branch.{name}"
    with _disk_errors(folder), atomic_file(folder / _FILE, durable=True) as unfinished:
        _write(unfinished, snapshot_id)


def restore_ref(path: Location, kind: Kind, name: str, snapshot_id: str) -> None:
    """Let a branch or a tag that is lost or damaged point to a snapshot again; durable when this returns.

    Raises:
        StorageError: The disk is full or not writable, or the bucket not within reach.
    """
    if isinstance(path, S3Prefix):
        write_object(path, f"refs/{kind}.{name}/{_FILE}", _content(snapshot_id).encode())
        return
    folder = path / "refs" / f"{kind}.{name}"
    with _disk_errors(folder):
        folder.mkdir(exist_ok=True)
        with atomic_file(folder / _FILE, durable=True) as unfinished:
            _write(unfinished, snapshot_id)


def is_deleted_tag(path: Location, name: str) -> bool:
    """Whether a tag was deleted on purpose, of which Icechunk keeps a tombstone."""
    return _TOMBSTONE in names_in(path, f"refs/tag.{name}")


def read_branch(path: Path, name: str) -> str | None:
    """The snapshot id that a branch of a local dataset says it leads to; None where it says nothing sound."""
    try:
        said = json.loads((path / "refs" / f"branch.{name}" / _FILE).read_bytes())
    except (OSError, ValueError):
        return None
    found = said.get("snapshot") if isinstance(said, dict) else None
    return found if isinstance(found, str) else None


def main_is_lost(path: Path) -> bool:
    """Whether a folder holds a dataset whose main branch is gone, damaged, or leads nowhere."""
    if read_branch(path, LEDGER_BRANCH) is None:
        return False
    tip = read_branch(path, DEFAULT_REF)
    return tip is None or not (path / "snapshots" / tip).is_file()


def create_ref(repository: icechunk.Repository, path: Location, kind: Kind, name: str, snapshot_id: str) -> None:
    """Make a branch or a tag that does not exist yet; durable when this returns.

    Raises:
        RefNameError: The name belonged to a tag that was deleted, of which Icechunk keeps a tombstone so that a name
            never means two versions; or in a bucket another process has just made a tag of it.
        StorageError: The disk is full or not writable.
        icechunk.IcechunkError: The object store refused it.
    """
    deleted = RefNameError(f"{name!r} was a release of {path} and was deleted: choose another")
    if isinstance(path, S3Prefix):
        if kind == "branch":
            repository.create_branch(name, snapshot_id)
            return
        try:
            repository.create_tag(name, snapshot_id)
        except icechunk.IcechunkError as error:
            if name in repository.list_tags():
                raise RefNameError(f"somebody has just released {name!r} of {path}: choose another name") from error
            raise deleted from error
        return
    if kind == "tag" and is_deleted_tag(path, name):
        raise deleted
    folder = path / "refs" / f"{kind}.{name}"
    # Icechunk takes a folder without file for a ref and fails, so the folder is renamed into place whole, and it is not
    # made among the refs.
    with _disk_errors(folder), atomic_folder(folder, beside=path, durable=True) as unfinished:
        unfinished.mkdir()
        _write(unfinished / _FILE, snapshot_id)
        sync(unfinished / _FILE)


def _write(file: Path, snapshot_id: str) -> None:
    file.write_text(_content(snapshot_id), encoding="utf-8")


def _content(snapshot_id: str) -> str:
    return json.dumps({"snapshot": snapshot_id}, separators=(",", ":"))


@contextmanager
def _disk_errors(folder: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise StorageError(
            f"cannot write {folder / _FILE}: {error.strerror}; check that the disk is writable and not full"
        ) from error
