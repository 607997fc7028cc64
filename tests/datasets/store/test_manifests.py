"""Manifests are compared with what snapshots say of them."""

from __future__ import annotations

from pathlib import Path

import icechunk
import pytest
import zarr
from zarr.codecs import Crc32cCodec
from zarr.core.sync import sync

from handsight.datasets import DatasetError, GraspRepository
from handsight.datasets.format.arrays import array_at, read_all
from handsight.datasets.store.file_damage import FileDamage
from handsight.datasets.store.snapshot_reader import SnapshotReader
from handsight.datasets.store.version_files import VersionFiles

PATH = "/beside"
TAIL_BYTES = 24
"""The end of a manifest of one chunk: where in the array it is, how long, and its bytes."""


@pytest.fixture
def manifest(repository: GraspRepository) -> Path:
    """That of an array with one chunk of two; the other was never written."""
    transaction = repository.writable("main")
    array = zarr.open_group(transaction.store, mode="r+").create_array(
        PATH, shape=(2,), chunks=(1,), dtype="i8", compressors=Crc32cCodec()
    )
    array[0] = 5
    repository.commit(transaction, branch="main", message="one chunk")
    (written,) = SnapshotReader(repository).snapshot(repository.resolve("main")).nodes[PATH].manifests
    return repository.folder / "manifests" / written.id


def test_whole_manifests_are_not_damaged(repository: GraspRepository, manifest: Path) -> None:
    assert _damage(repository) == []


def test_a_manifest_that_is_gone_is_damage(repository: GraspRepository, manifest: Path) -> None:
    manifest.unlink()
    (found,) = _damage(GraspRepository.open(repository.path))
    assert found.file == f"manifests/{manifest.name}"
    assert found.fault.startswith("of beside cannot be read")


def test_a_chunk_that_moved_is_damage_though_their_number_is_right(repository: GraspRepository, manifest: Path) -> None:
    """Which reads as the fill value: no checksum is asked."""
    whole = manifest.read_bytes()
    moved = 0
    for bit in range(8 * (len(whole) - TAIL_BYTES), 8 * len(whole)):
        spoilt = bytearray(whole)
        spoilt[bit // 8] ^= 1 << bit % 8
        manifest.write_bytes(spoilt)
        try:
            session = GraspRepository.open(repository.path).icechunk_repository.readonly_session("main")
            read = read_all(array_at(zarr.open_group(session.store, mode="r"), PATH))
        except (DatasetError, ValueError, icechunk.IcechunkError):
            continue
        if list(read) != [5, 0]:
            (found,) = _damage(GraspRepository.open(repository.path))
            assert found.file == f"manifests/{manifest.name}"
            moved += sync(_count(session)) == 1
    assert moved


async def _count(session: icechunk.Session) -> int:
    return len([one async for one in session.chunk_coordinates(PATH)])


def _damage(repository: GraspRepository) -> list[FileDamage]:
    return VersionFiles(repository, repository.resolve("main")).damage(lambda path: path == PATH)
