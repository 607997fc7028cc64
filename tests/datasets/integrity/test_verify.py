"""Verification finds every damaged byte and names the attempt."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import zarr
from tests.support.factories import make_attempt, make_header, record
from tests.support.versions import opened

from handsight.datasets import Curator, DatasetError, GraspRepository, Outcome, Selection, verify
from handsight.datasets.curation.scores import save_scores
from handsight.datasets.format.arrays import array_at, group_at
from handsight.datasets.store.snapshot_reader import SnapshotReader

FLIPS = int(os.environ.get("HANDSIGHT_FLIPS", "60"))
HEADER = make_header(width=32, height=24)


@pytest.fixture
def recorded(repository: GraspRepository) -> GraspRepository:
    """Two sessions of 20 and 3 attempts."""
    for seed, size in ((1, 20), (2, 3)):
        header = make_header(seed=seed, width=32, height=24)
        record(repository, header, [make_attempt(header, number) for number in range(size)], every=7)
    return repository


def tamper(repository: GraspRepository, change: Callable[[zarr.Group], None]) -> None:
    """Write past all checks, as somebody with a Zarr library could; the checksums are then right."""
    transaction = repository.writable("main")
    change(zarr.open_group(transaction.store, mode="r+"))
    repository.commit(transaction, branch="main", message="tamper")


@pytest.fixture
def eager(monkeypatch: pytest.MonkeyPatch) -> None:
    """A process for every few attempts, in ranges of two."""
    for name, value in (("_WORTH_A_PROCESS", 4), ("_RANGE", 2)):
        monkeypatch.setattr(sys.modules["handsight.datasets.integrity.verify"], name, value)


@pytest.mark.parametrize("jobs", [1, 3])
@pytest.mark.usefixtures("eager")
def test_an_undamaged_version_is_verified_whole(recorded: GraspRepository, jobs: int) -> None:
    seen: list[int] = []
    report = verify(opened(recorded), jobs=jobs, on_checked=seen.append)
    assert (report.checked, report.corrupt, report.damage, report.ok) == (23, (), (), True)
    assert seen[-1] == 23
    assert report.bytes > 23 * 1000


@pytest.mark.usefixtures("eager")
def test_processes_find_what_one_finds(recorded: GraspRepository) -> None:
    def damage(root: zarr.Group) -> None:
        ulid = sorted(group_at(root, "sessions").group_keys())[0]
        array_at(root, f"sessions/{ulid}/overhead/rgb")[3] = 7
        array_at(root, f"sessions/{ulid}/attempts/number")[11] = 12

    tamper(recorded, damage)
    alone, together = (verify(opened(recorded), jobs=jobs) for jobs in (1, 3))
    assert together == alone
    assert [attempt[-6:] for attempt in alone.faults] == ["000003", "000011"]


def test_an_empty_version_is_verified(repository: GraspRepository) -> None:
    assert verify(opened(repository)).ok


@pytest.mark.no_cover
def test_every_flipped_bit_in_pictures_and_columns_is_found(repository: GraspRepository) -> None:
    """HANDSIGHT_FLIPS sets how many bits are flipped, one at a time."""
    attempts = [make_attempt(HEADER, number, outcome=Outcome.HELD) for number in range(6)]
    record(repository, HEADER, attempts, every=6)
    dataset = opened(repository)
    ids = set(dataset.attempts.index)
    chunks = sorted((repository.folder / "chunks").iterdir())
    assert len(chunks) > 6 * 4
    rng = np.random.default_rng(FLIPS)
    missed = []
    for _ in range(FLIPS):
        chunk = chunks[rng.integers(len(chunks))]
        whole = chunk.read_bytes()
        damaged = bytearray(whole)
        damaged[rng.integers(len(whole))] ^= 1 << int(rng.integers(8))
        chunk.write_bytes(damaged)
        report = verify(opened(repository), jobs=1)
        picture = report.faults and all("rgb" in fault or "depth" in fault for fault in report.faults.values())
        if not report.corrupt or not ids.issuperset(report.corrupt) or (picture and len(report.corrupt) != 1):
            missed.append((chunk.name, report.faults))
        chunk.write_bytes(whole)
    assert missed == []
    assert verify(opened(repository), jobs=1).ok


@pytest.mark.no_cover
def test_flipped_bits_in_what_the_engine_keeps_are_found_or_change_nothing(recorded: GraspRepository) -> None:
    """Manifests hold small chunks and where the others are; the engine has no checksum for them."""
    before = opened(recorded)
    rng = np.random.default_rng(1)
    manifests = sorted((recorded.folder / "manifests").iterdir())
    for _ in range(30):
        manifest = manifests[rng.integers(len(manifests))]
        whole = manifest.read_bytes()
        damaged = bytearray(whole)
        damaged[rng.integers(len(whole))] ^= 1 << int(rng.integers(8))
        manifest.write_bytes(damaged)
        try:
            dataset = opened(recorded)
            if verify(dataset, jobs=1).ok:
                assert dataset.attempts.equals(before.attempts)
        except DatasetError:
            pass
        manifest.write_bytes(whole)


def test_chunks_that_no_digest_covers_are_missed_when_the_engine_loses_them(recorded: GraspRepository) -> None:
    """They read as the fill value, which of a clock says that it is not known, and of a score that there is none."""
    dataset = opened(recorded)
    save_scores(recorded, "guess", pd.Series(0.5, index=dataset.attempts.index), source="a test", author="jo")
    nodes = SnapshotReader(recorded).snapshot(recorded.resolve("main")).nodes
    manifests = {path: [one.id for one in node.manifests] for path, node in nodes.items()}
    clocks = [path for path in manifests if path.endswith("/attempts/started_elapsed_ns")]
    beside = [path for path, held in manifests.items() if held and not path.startswith("/sessions/")]
    assert len(clocks) == 2
    assert any("guess" in path for path in beside)
    (other,) = manifests[next(path for path in manifests if path.endswith("/attempts/contact_force_n"))]
    for path in (*clocks, *beside):
        (manifest,) = (recorded.folder / "manifests" / one for one in manifests[path])
        whole = manifest.read_bytes()
        manifest.write_bytes((recorded.folder / "manifests" / other).read_bytes())
        damage = verify(opened(recorded), jobs=1).damage
        assert any(manifest.name in fault and path.strip("/") in fault for fault in damage), path
        manifest.write_bytes(whole)
    assert verify(opened(recorded), jobs=1).ok


def test_pictures_that_changed_places_are_found(recorded: GraspRepository) -> None:
    dataset = opened(recorded)
    first, second = dataset.attempts.index[dataset.attempts["overhead_taken"]][:2]
    session = dataset.sessions[0].ulid

    def swap(root: zarr.Group) -> None:
        array = array_at(root, f"sessions/{session}/overhead/rgb")
        rows = [int(identity.rpartition("-")[2]) for identity in (first, second)]
        array[rows[0]], array[rows[1]] = np.asarray(array[rows[1]]), np.asarray(array[rows[0]])

    tamper(recorded, swap)
    report = verify(opened(recorded))
    assert report.corrupt == (first, second)
    assert "its content has digest" in report.faults[first]


@pytest.mark.parametrize(
    ("path", "fault"),
    [
        ("attempts/outcome", "digest|make no attempt"),
        ("attempts/gripper_width_m", "its content has digest"),
        ("attempts/digest", "its content has digest"),
        ("attempts/number", "row 2 holds the number"),
        ("overhead/pose_base_tool", "its content has digest"),
    ],
)
def test_a_value_changed_with_its_checksum_is_found(repository: GraspRepository, path: str, fault: str) -> None:
    record(repository, HEADER, [make_attempt(HEADER, number, outcome=Outcome.HELD) for number in range(4)])
    session = opened(repository).sessions[0].ulid

    def change(root: zarr.Group) -> None:
        array = array_at(root, f"sessions/{session}/{path}")
        array[2] = np.asarray(array[2]) + 1

    tamper(repository, change)
    report = verify(opened(repository))
    assert report.corrupt == (f"{session}-000002",)
    (found,) = report.faults.values()
    assert any(part in found for part in fault.split("|"))


def test_a_changed_provenance_is_found(recorded: GraspRepository) -> None:
    session = opened(recorded).sessions[1].ulid

    def change(root: zarr.Group) -> None:
        root[f"sessions/{session}"].attrs["started"] = "2001-01-01T00:00:00+00:00"

    tamper(recorded, change)
    report = verify(opened(recorded))
    assert not report.ok
    assert report.damage == (f"session {session}: header, config_digest, code, packages, started are not as recorded",)


def test_a_missing_tail_is_found(recorded: GraspRepository) -> None:
    session = opened(recorded).sessions[1].ulid

    def change(root: zarr.Group) -> None:
        array = array_at(root, f"sessions/{session}/pregrasp/depth")
        array.resize((2, *array.shape[1:]))

    tamper(recorded, change)
    report = verify(opened(recorded))
    assert report.corrupt == (f"{session}-000002",)
    assert "ends at row 2" in report.faults[f"{session}-000002"]


def test_damaged_curation_is_reported_beside_the_attempts(recorded: GraspRepository) -> None:
    chunks = recorded.folder / "chunks"
    before = {path.name for path in chunks.iterdir()}
    # Small chunks are kept within the manifests: this text does not compress to one.
    for number in range(3):
        Curator(recorded, author="anna").exclude(Selection(where=f"number == {number}"), _noise(number))
    dataset = opened(recorded)
    new = [path for path in chunks.iterdir() if path.name not in before]
    _flip(max(new, key=lambda path: path.stat().st_mtime_ns))
    report = verify(dataset)
    assert report.corrupt == ()
    assert not report.ok
    assert "curation/" in report.damage[0]


def _noise(seed: int) -> str:
    return np.random.default_rng(seed).bytes(256).hex()


def _flip(path: Path) -> None:
    damaged = bytearray(path.read_bytes())
    damaged[len(damaged) // 2] ^= 1
    path.write_bytes(damaged)
