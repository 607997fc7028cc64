"""Sessions copied by id: whole, once, and only where they belong."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from tests.support.factories import difference, make_attempt, make_header, record

from handsight.datasets import (
    GraspDataset,
    GraspRepository,
    MergeError,
    RefNotFoundError,
    SessionHeader,
    SessionNotFoundError,
    SessionWriter,
)
from handsight.datasets.curation.curator import Curator
from handsight.datasets.exchange.merge import merge
from handsight.datasets.reading.selection import Selection


def sized(repository: GraspRepository, header: SessionHeader, size: int) -> str:
    return record(repository, header, [make_attempt(header, number) for number in range(size)], every=50).session


@pytest.fixture
def source(tmp_path: Path) -> GraspDataset:
    """Two sessions; the first is longer than a chunk of a column."""
    repository = GraspRepository.create(tmp_path / "source")
    for seed, size in ((1, 259), (2, 5)):
        sized(repository, make_header(seed=seed, width=4, height=3), size)
    return GraspDataset.open(str(repository.path))


HERE = {"width": 4, "height": 3}


def test_a_merge_copies_every_byte_and_decision(source: GraspDataset, repository: GraspRepository) -> None:
    sized(repository, make_header(seed=3, **HERE), 4)
    mine = GraspDataset.open(str(repository.path))
    Curator(repository, author="me").exclude(Selection(ids=(mine.attempts.index[0],)), "first")
    curator = Curator(source.repository, author="jo")
    curator.exclude(Selection(ids=tuple(source.attempts.index[[0, 260]])), "dark")
    curator.exclude(Selection(ids=(source.attempts.index[261],)), "blurred")
    curator.undo()
    curated = GraspDataset.open(str(source.repository.path))
    seen: list[int] = []
    report = merge(curated, repository, on_attempt=lambda: seen.append(1))
    assert (len(report.sessions), report.attempts, report.duplicates, len(seen)) == (2, 264, (), 264)
    merged = GraspDataset.open(str(repository.path))
    assert merged.snapshot_id == report.snapshot
    assert set(merged.attempts.index) == set(mine.attempts.index) | set(source.attempts.index)
    assert merged.attempts.loc[source.attempts.index].equals(curated.attempts)
    assert merged.attempts.loc[mine.attempts.index[0], "exclusion_reason"] == "first"
    for identity in source.attempts.index[[0, 15, 16, 255, 256, 258, 263]]:
        assert difference(merged.attempt(identity), source.attempt(identity)) is None
    assert repository.log()[0].attempts_added == 264


def test_a_merged_session_can_be_resumed(source: GraspDataset, repository: GraspRepository) -> None:
    merge(source, repository)
    header = make_header(seed=1, **HERE)
    with SessionWriter.resume(repository, header) as writer:
        assert writer.next_number == 259
        writer.append(make_attempt(header, 259))
    expected = [make_attempt(header, number) for number in (255, 258, 259)]
    merged = GraspDataset.open(str(repository.path))
    for attempt in expected:
        assert difference(merged.attempt(f"{writer.session}-{attempt.number:06d}"), attempt) is None


def test_only_the_sessions_named_are_copied(source: GraspDataset, repository: GraspRepository) -> None:
    wanted = source.sessions[1].ulid
    report = merge(source, repository, sessions=[wanted, wanted], dry_run=True)
    assert (report.sessions, report.snapshot) == ((wanted,), None)
    assert GraspDataset.open(str(repository.path)).sessions == ()
    merge(source, repository, sessions=[wanted])
    assert GraspDataset.open(str(repository.path)).sessions == (source.sessions[1],)
    with pytest.raises(SessionNotFoundError, match="no session nope, nada"):
        merge(source, repository, sessions=["nope", wanted, "nada"])
    with pytest.raises(RefNotFoundError):
        merge(source, repository, branch="nope")


def test_merging_twice_changes_nothing(source: GraspDataset, repository: GraspRepository) -> None:
    once = merge(source, repository).snapshot
    report = merge(source, repository)
    assert (report.sessions, report.attempts, report.snapshot) == ((), 0, None)
    assert report.duplicates == tuple(session.ulid for session in source.sessions)
    assert repository.resolve("main") == once


def test_the_same_attempts_under_another_id_are_left_out(source: GraspDataset, repository: GraspRepository) -> None:
    """The same seed gives the same content, whoever collected it."""
    sized(repository, make_header(seed=2, **HERE), 5)
    report = merge(source, repository)
    assert report.duplicates == (source.sessions[1].ulid,)
    assert report.sessions == (source.sessions[0].ulid,)


def test_a_session_that_overlaps_is_refused(source: GraspDataset, repository: GraspRepository) -> None:
    sized(repository, make_header(seed=2, **HERE), 3)
    before = repository.resolve("main")
    with pytest.raises(MergeError, match="shares 3 of its 5 attempts with session"):
        merge(source, repository)
    assert repository.resolve("main") == before


def test_a_session_that_went_on_elsewhere_is_refused(source: GraspDataset, repository: GraspRepository) -> None:
    merge(source, repository)
    header = make_header(seed=2, **HERE)
    with SessionWriter.resume(source.repository, header) as writer:
        writer.append(make_attempt(header, 5))
    longer = GraspDataset.open(str(source.repository.path))
    with pytest.raises(MergeError, match="is there with 5 attempts and other content"):
        merge(longer, repository)
    assert merge(source, longer.repository).duplicates == tuple(session.ulid for session in source.sessions)


def test_all_mismatches_are_named_at_once(source: GraspDataset, repository: GraspRepository) -> None:
    header = make_header(seed=3, width=8, height=3, depth_scale_m=1e-4, closed_width_m=0.001)
    camera = replace(header.station.camera, y_tool_camera_m=-0.05)
    header = replace(header, station=replace(header.station, camera=camera))
    sized(repository, header, 1)
    before = repository.resolve("main")
    with pytest.raises(MergeError) as caught:
        merge(source, repository)
    for name in ("width 4", "cx", "depth_scale_m", "closed_width_m", "y_tool_camera_m -0.071, the dataset -0.05"):
        assert str(caught.value).count(name) == len(source.sessions)
    assert repository.resolve("main") == before
    assert merge(source, repository, allow_mismatch=True).attempts == 264
    assert merge(source, repository).attempts == 0
