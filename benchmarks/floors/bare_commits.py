"""Commits of what handsight has committed, by Icechunk alone: the floor under a commit."""

from __future__ import annotations

import asyncio
from pathlib import Path

import icechunk
import zarr
from zarr.abc.buffer import Buffer
from zarr.abc.store import Store
from zarr.buffer import cpu
from zarr.core.sync import sync

from benchmarks import duration_s
from handsight.datasets import GraspRepository
from handsight.datasets.store.icechunk_engine import publish
from handsight.datasets.writing.batches import session_arrays


class BareRepository:
    """A repository that is given the same files as a dataset, without handsight or zarr in between."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._engine = icechunk.Repository.create(icechunk.local_filesystem_storage(str(folder)))

    def commit_s(self, files: dict[str, Buffer]) -> float:
        """The time to write the files and to make them durable [s]."""
        return duration_s(lambda: self._commit(files))

    def _commit(self, files: dict[str, Buffer]) -> None:
        session = self._engine.writable_session("main")
        sync(_write(session.store, files))
        publish(self._engine, session, root=self._folder, branch="main", message="bare", metadata={})


def last_commit(repository: GraspRepository, session: str, number: int) -> dict[str, Buffer]:
    """What the commit of one attempt wrote, by the names that zarr gives it: metadata and the last chunk of arrays."""
    root = repository.root(repository.resolve("main"))
    group = root[f"sessions/{session}"]
    assert isinstance(group, zarr.Group)
    folders = ["", "sessions/", *(f"{one.path}/" for one in (group, *dict(group.groups()).values()))]
    names = [f"{folder}zarr.json" for folder in folders]
    for array in session_arrays(group).values():
        last = (number // array.chunks[0], *[0] * (array.ndim - 1))
        names += [f"{array.path}/zarr.json", f"{array.path}/{array.metadata.encode_chunk_key(last)}"]
    return sync(_read(root.store, names))


async def _read(store: Store, names: list[str]) -> dict[str, Buffer]:
    found = {name: await store.get(name, cpu.buffer_prototype) for name in names}
    return {name: data for name, data in found.items() if data is not None}


async def _write(store: Store, files: dict[str, Buffer]) -> None:
    metadata = [name for name in files if name.endswith("zarr.json")]
    await asyncio.gather(*(store.set(name, files[name]) for name in metadata))
    await asyncio.gather(*(store.set(name, data) for name, data in files.items() if name not in metadata))
