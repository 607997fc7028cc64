"""Whether manifests name the chunks that a snapshot says they do.

Manifests have no checksum, and a chunk that one no longer names, or names elsewhere, reads as the fill value.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterator, Mapping, Sequence

import icechunk
from zarr.core.sync import sync

from handsight.datasets.errors import CorruptDataError, counted
from handsight.datasets.store.file_damage import FileDamage
from handsight.datasets.store.snapshot_reader import Extents, ManifestRef, Snapshot, SnapshotReader

_ARRAYS_AT_A_TIME = 32
"""Each has a file open."""


def manifest_damage(
    reader: SnapshotReader, snapshot: Snapshot, store: icechunk.IcechunkStore, paths: Sequence[str]
) -> Iterator[FileDamage]:
    """Manifests that cannot be read, or that name too few or too many chunks.

    Args:
        reader: Of the dataset.
        snapshot: What it says of itself.
        store: Its content.
        paths: The arrays whose manifests are read.

    Raises:
        StorageError: The machine cannot read them.
    """
    for start in range(0, len(paths), _ARRAYS_AT_A_TIME):
        some = {path: snapshot.nodes[path].manifests for path in paths[start : start + _ARRAYS_AT_A_TIME]}
        named = sync(_chunk_counts(store.session, some))
        for (path, manifests), count in zip(some.items(), named, strict=True):
            files = ", ".join(f"manifests/{one.id}" for one in manifests)
            expected = sum(snapshot.chunk_counts.get(one.id, 0) for one in manifests)
            try:
                with reader.reading(files):
                    if isinstance(count, BaseException):
                        raise count
            except CorruptDataError as error:
                yield FileDamage(file=files, fault=f"of {path.lstrip('/')} {error}")
                continue
            if count != expected:
                fault = f"of {path.lstrip('/')} names {counted(count, 'chunk')} of it, and the snapshot says {expected}"
                yield FileDamage(file=files, fault=fault)


async def _chunk_counts(
    session: icechunk.Session, arrays: Mapping[str, tuple[ManifestRef, ...]]
) -> list[int | BaseException]:
    """How many chunks of an array its manifests name, or what is raised for it.

    Who reads the array does not find a chunk that a flipped bit has moved out of it.
    """

    async def count(path: str) -> int:
        found = [one async for one in session.chunk_coordinates(path)]
        return sum(any(_within(chunk, one.extents) for one in arrays[path]) for chunk in found)

    return await asyncio.gather(*map(count, arrays), return_exceptions=True)


def _within(chunk: Sequence[int], extents: Extents) -> bool:
    return len(chunk) == len(extents) and all(
        first <= at < end for at, (first, end) in zip(chunk, extents, strict=True)
    )
