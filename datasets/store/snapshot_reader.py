"""What a snapshot of Icechunk says of itself: its groups and arrays, and where their manifests have chunks."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import icechunk
from zarr.abc.store import Store
from zarr.core.buffer import default_buffer_prototype
from zarr.core.sync import sync

from handsight.datasets.errors import CorruptDataError, DatasetError, headline
from handsight.datasets.machine import of_the_machine
from handsight.datasets.store.repository import GraspRepository

Extents = tuple[tuple[int, int], ...]
"""The first chunk of a manifest and the one after its last, along every axis of an array."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ManifestRef:
    """A manifest of an array."""

    id: str
    extents: Extents


@dataclass(frozen=True, slots=True, kw_only=True)
class Node:
    """A group or an array."""

    id: str
    kind: str
    manifests: tuple[ManifestRef, ...]

    def is_still(self, other: Node) -> bool:
        """Whether this is the same group or array, with whatever chunks."""
        return (self.id, self.kind) == (other.id, other.kind)


@dataclass(frozen=True, slots=True, kw_only=True)
class Snapshot:
    """What a snapshot says of itself."""

    id: str
    parent: str | None
    branch: str | None
    """Where it was committed; None where that was not noted."""
    nodes: dict[str, Node]
    """Every group and array, by path."""
    chunk_counts: dict[str, int]
    """How many chunks each manifest names, by its id."""


class SnapshotReader:
    """Reads snapshots of a dataset, and says whose fault it is where that fails."""

    def __init__(self, repository: GraspRepository) -> None:
        self._path = repository.path
        self._engine = repository.icechunk_repository

    def snapshot(self, snapshot_id: str) -> Snapshot:
        """What a snapshot says of itself.

        Raises:
            CorruptDataError, StorageError: It cannot be read.
        """
        with self.reading(f"snapshot {snapshot_id}"):
            said = json.loads(self._engine.inspect_snapshot(snapshot_id))
            if said["id"] != snapshot_id:
                raise CorruptDataError(f"says that it is {said['id']}")
            return Snapshot(
                id=snapshot_id,
                parent=said.get("parent_id"),
                branch=said["metadata"].get("branch"),
                nodes={
                    node["path"]: Node(
                        id=node["id"],
                        kind=node["node_type"],
                        manifests=tuple(map(_manifest_ref, node.get("manifest_refs", ()))),
                    )
                    for node in said["nodes"]
                },
                chunk_counts={one["id"]: one["num_chunk_refs"] for one in said["manifests"]},
            )

    def store(self, snapshot_id: str) -> icechunk.IcechunkStore:
        """The content of a snapshot.

        Raises:
            CorruptDataError, StorageError: The snapshot cannot be read.
        """
        with self.reading(f"snapshot {snapshot_id}"):
            return self._engine.readonly_session(snapshot_id=snapshot_id).store

    def descriptions(self, store: Store, paths: Sequence[str], what: str) -> dict[str, bytes | None]:
        """The metadata of groups and arrays by path.

        Args:
            store: Their content.
            paths: Where they lie.
            what: What they are the metadata of, for the message of the machine's errors.

        Raises:
            CorruptDataError, StorageError: They cannot be read.
        """
        with self.reading(what):
            found = sync(_contents(store, [f"{path.strip('/')}/zarr.json".lstrip("/") for path in paths]))
        return dict(zip(paths, found, strict=True))

    def reading(self, what: str) -> _Reading:
        """A block in which something is read: what it raises is the machine's, or else damage."""
        return _Reading(f"{what} of {self._path} cannot be read")


class _Reading:
    """A block whose errors are those of the machine, or else damage."""

    def __init__(self, trouble: str) -> None:
        self._trouble = trouble

    def __enter__(self) -> None:
        pass

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if isinstance(error, DatasetError) or not isinstance(error, Exception):
            return
        if trouble := of_the_machine(self._trouble, error):
            raise trouble from error
        raise CorruptDataError(f"cannot be read ({headline(error)})") from error


def _manifest_ref(said: Mapping[str, Any]) -> ManifestRef:
    return ManifestRef(id=said["id"], extents=tuple((int(first), int(end)) for first, end in said["extents"]))


async def _contents(store: Store, keys: Sequence[str]) -> list[bytes | None]:
    found = await asyncio.gather(*(store.get(key, default_buffer_prototype()) for key in keys))
    return [None if one is None else one.to_bytes() for one in found]
