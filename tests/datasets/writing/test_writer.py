"""What the writer takes, what it refuses, and what is left after it stops."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zarr
from tests.support.factories import make_attempt, make_header, make_station, record

from handsight.datasets import (
    GraspAttempt,
    GraspDataset,
    GraspRepository,
    HeaderError,
    Outcome,
    RecordError,
    RefNotFoundError,
    RgbdFrame,
    SceneObjects,
    SessionConflictError,
    SessionHeader,
    SessionNotFoundError,
    SessionWriter,
    StorageError,
)
from handsight.datasets.format.arrays import array_at
from handsight.datasets.store import icechunk_engine

HEADER = make_header()
HELD = make_attempt(HEADER, 0, outcome=Outcome.HELD)
ABORTED = make_attempt(HEADER, 0, outcome=Outcome.ABORTED)
SCENE = SceneObjects(
    catalogue_index=np.array([0, 4], np.int16), pose_base_object=np.zeros((2, 7)), target=1, conditions=np.ones(2)
)


def overhead(**changes: Any) -> GraspAttempt:
    assert HELD.overhead is not None
    return replace(HELD, overhead=replace(HELD.overhead, **changes))


def scene(**changes: Any) -> GraspAttempt:
    return replace(HELD, scene=replace(SCENE, **changes))


def gripper(**changes: Any) -> GraspAttempt:
    return replace(HELD, gripper=replace(HELD.gripper, **changes))


FAULTS: dict[str, tuple[GraspAttempt, str]] = {
    "number": (replace(HELD, number=1), "number is 1, expected 0"),
    "rgb shape": (overhead(rgb=np.zeros((6, 9, 3), np.uint8)), r"overhead.rgb has shape \(6, 9, 3\), expected \(6, 8"),
    "rgb type": (overhead(rgb=np.zeros((6, 8, 3), np.float32)), "overhead.rgb has type float32, expected uint8"),
    "depth type": (overhead(depth=np.zeros((6, 8), np.int32)), "overhead.depth has type int32"),
    "depth no array": (overhead(depth=[[0]]), "overhead.depth is a list"),
    "pose": (overhead(pose_base_tool=2 * np.eye(4)), "overhead.pose_base_tool is no rigid transform"),
    "mirrored pose": (overhead(pose_base_tool=np.diag([1.0, 1, -1, 1])), "no rigid transform"),
    "pose NaN": (overhead(pose_base_tool=np.full((4, 4), np.nan)), "overhead.pose_base_tool is not finite"),
    "no overhead": (replace(HELD, overhead=None), "overhead is missing with outcome HELD"),
    "pregrasp pose": (replace(HELD, pregrasp_x_m=float("nan")), "pregrasp_x_m is nan, expected finite"),
    "infinite pose": (replace(ABORTED, pregrasp=None, pregrasp_y_m=float("inf")), "pregrasp_y_m is inf"),
    "grasp pose": (replace(HELD, pose_base_tool_grasp=np.full((4, 4), np.nan)), "pose_base_tool_grasp is not finite"),
    "force": (replace(HELD, contact_force_n=float("nan")), "contact_force_n is nan"),
    "final": (gripper(final_m=float("nan")), "final_m is NaN with outcome HELD"),
    "closed but held": (gripper(final_m=0.002), "outcome is HELD with gripper.final_m 0.002 m, at or below"),
    "open but empty": (replace(HELD, outcome=Outcome.EMPTY), "above the closed width 0.002 m, expected HELD"),
    "infinite reading": (gripper(closed_m=float("inf")), "gripper.closed_m is inf"),
    "label with failure": (replace(HELD, failure="lift: slipped"), "expected none"),
    "no reason": (replace(ABORTED, failure=""), "expected 'phase: reason'"),
    "unknown phase": (replace(ABORTED, failure="dance: no"), "with a phase of settle, look"),
    "long failure": (replace(ABORTED, failure="look: " + "é" * 300), "expected 512 bytes"),
    "NUL": (replace(ABORTED, failure="look: a\0"), "without NUL"),
    "surrogate": (replace(ABORTED, failure="look: \ud800"), "lone surrogate"),
    "index": (scene(catalogue_index=np.array([0, 5], np.int16)), r"catalogue_index holds \[5\], expected 0 to 4"),
    "negative index": (scene(catalogue_index=np.array([-1, 0], np.int16)), r"catalogue_index holds \[-1\]"),
    "index type": (scene(catalogue_index=np.array([0, 1], np.int64)), "catalogue_index has type int64"),
    "object poses": (scene(pose_base_object=np.zeros((3, 7))), r"pose_base_object has shape \(3, 7\), expected \(2, 7"),
    "object NaN": (scene(pose_base_object=np.full((2, 7), np.nan)), "pose_base_object is not finite"),
    "target": (scene(target=2), "scene.target is 2, expected 0 to 1"),
    "too many": (
        scene(catalogue_index=np.zeros(4, np.int16), pose_base_object=np.zeros((4, 7))),
        "scene has 4 objects, expected at most 3",
    ),
    "phases": (replace(HELD, phase_s=np.ones(6, np.float32)), r"phase_s has shape \(6,\), expected \(7,\)"),
    "phase time": (replace(HELD, phase_s=np.full(7, -1, np.float32)), "phase_s of settle is -1.0 s"),
    "clock": (replace(HELD, started_ns=-1), "started_ns is -1"),
}


@pytest.mark.parametrize("case", FAULTS)
def test_a_bad_record_is_refused_and_changes_nothing(repository: GraspRepository, case: str) -> None:
    attempt, message = FAULTS[case]
    writer = SessionWriter.begin(repository, HEADER)
    with pytest.raises(RecordError, match=message):
        writer.append(attempt)
    assert writer.next_number == 0
    assert writer.commit() is None
    assert len(repository.log()) == 1


def test_all_faults_are_reported_at_once(repository: GraspRepository) -> None:
    attempt = replace(gripper(final_m=float("nan")), number=3, contact_force_n=float("inf"), overhead=None)
    with pytest.raises(RecordError) as caught:
        SessionWriter.begin(repository, HEADER).append(attempt)
    for part in ("number is 3", "final_m is NaN", "contact_force_n is inf", "overhead is missing"):
        assert part in str(caught.value)


@pytest.mark.parametrize(
    ("header", "message"),
    [
        (make_header(source="Sim 1"), "source is 'Sim 1'"),
        (make_header(depth_scale_m=0.0), "depth_scale_m is 0.0"),
        (make_header(pregrasp_height_m=0.0), "pregrasp_height_m is 0.0"),
        (make_header(closed_width_m=0.1), "expected 0 <= closed < stroke"),
        (make_header(objects=("cup", "cup")), "objects names cup more than once"),
        (make_header(seed=-1), "seed is -1"),
        (make_header(objects_per_scene=-1), "objects_per_scene is -1"),
        (replace(HEADER, config={"x": float("nan")}), "config is not JSON"),
        (replace(HEADER, config={"x": Path("a")}), "config is not JSON"),
        (replace(HEADER, seed=-1, config={"x": {1, 2}}), "seed is -1.*; config is not JSON"),
    ],
)
def test_a_bad_header_is_refused(repository: GraspRepository, header: SessionHeader, message: str) -> None:
    for start in (SessionWriter.begin, SessionWriter.resume):
        with pytest.raises(HeaderError, match=message):
            start(repository, header)


@pytest.mark.parametrize("start", [SessionWriter.begin, SessionWriter.resume])
def test_an_unknown_branch_is_refused(repository: GraspRepository, start: Callable[..., SessionWriter]) -> None:
    with pytest.raises(RefNotFoundError, match="no branch 'dev'"):
        start(repository, HEADER, branch="dev")


def test_append_takes_a_copy(repository: GraspRepository) -> None:
    attempt = make_attempt(HEADER, 0, outcome=Outcome.HELD)
    assert attempt.overhead is not None
    kept = attempt.overhead.rgb.copy()
    with SessionWriter.begin(repository, HEADER) as writer:
        identity = writer.append(attempt)
        attempt.overhead.rgb[:] = 0
        attempt.pose_base_tool_grasp[:] = 0
    stored = GraspDataset.open(str(repository.path)).attempt(identity)
    assert stored.overhead is not None
    np.testing.assert_array_equal(stored.overhead.rgb, kept)
    assert stored.pose_base_tool_grasp[3, 3] == 1


def test_nothing_shows_before_the_first_commit(repository: GraspRepository) -> None:
    writer = SessionWriter.begin(repository, HEADER)
    writer.append(HELD)
    assert GraspDataset.open(str(repository.path)).sessions == ()
    assert writer.commit("one") == repository.resolve("main")
    (session,) = GraspDataset.open(str(repository.path)).sessions
    assert (session.ulid, session.attempts, session.status, session.ended) == (writer.session, 1, "open", None)


def test_seal_marks_the_session_and_a_later_attempt_opens_it_again(repository: GraspRepository) -> None:
    writer = record(repository, HEADER, [HELD])
    (sealed,) = GraspDataset.open(str(repository.path)).sessions
    assert sealed.status == "sealed"
    assert sealed.ended is not None
    resumed = SessionWriter.resume(repository, HEADER)
    assert (resumed.session, resumed.next_number) == (writer.session, 1)
    resumed.append(make_attempt(HEADER, 1))
    resumed.commit()
    (opened,) = GraspDataset.open(str(repository.path)).sessions
    assert (opened.status, opened.ended, opened.attempts) == ("open", None, 2)


def test_a_session_without_attempts_leaves_no_trace(repository: GraspRepository) -> None:
    with SessionWriter.begin(repository, HEADER) as writer:
        assert writer.seal() is None
    assert len(repository.log()) == 1


def test_an_exception_drops_only_what_was_not_committed(repository: GraspRepository) -> None:
    writer = SessionWriter.begin(repository, HEADER)

    def record_and_fail() -> None:
        with writer:
            writer.append(make_attempt(HEADER, 0))
            writer.commit()
            writer.append(make_attempt(HEADER, 1))
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        record_and_fail()
    assert len(GraspDataset.open(str(repository.path)).attempts) == 1
    assert SessionWriter.resume(repository, HEADER).next_number == 1


def test_begin_refuses_to_record_the_same_twice(repository: GraspRepository) -> None:
    record(repository, HEADER, [HELD])
    with pytest.raises(SessionConflictError, match="--resume, or choose another seed"):
        SessionWriter.begin(repository, HEADER)
    SessionWriter.begin(repository, make_header(seed=2))
    SessionWriter.begin(repository, replace(HEADER, config={"shakes": 0}))
    SessionWriter.begin(repository, make_header(depth_scale_m=1e-4))


def test_two_that_begin_the_same_at_once_cannot_both_commit(repository: GraspRepository) -> None:
    first, second = (SessionWriter.begin(GraspRepository.open(repository.path), HEADER) for _ in range(2))
    first.append(HELD)
    second.append(HELD)
    first.commit()
    with pytest.raises(SessionConflictError, match="already holds session"):
        second.commit()
    assert len(GraspDataset.open(str(repository.path)).attempts) == 1


def test_two_that_resume_the_same_cannot_overwrite_each_other(repository: GraspRepository) -> None:
    record(repository, HEADER, [make_attempt(HEADER, 0)])
    first, second = (SessionWriter.resume(GraspRepository.open(repository.path), HEADER) for _ in range(2))
    first.append(make_attempt(HEADER, 1))
    second.append(make_attempt(HEADER, 1))
    first.commit()
    with pytest.raises(SessionConflictError, match="another process went on with it"):
        second.commit()
    assert len(GraspDataset.open(str(repository.path)).attempts) == 2


def test_changes_to_the_same_session_conflict_at_the_commit(repository: GraspRepository) -> None:
    """The narrower race: both have written before either commits."""
    session = record(repository, HEADER, [make_attempt(HEADER, 0)]).session
    transactions = [repository.writable("main") for _ in range(2)]
    for transaction in transactions:
        root = zarr.open_group(transaction.store, mode="r+")
        array = array_at(root, f"sessions/{session}/attempts/number")
        array.resize((2,))
        array[1:] = 1
    repository.commit(transactions[0], branch="main", message="first")
    with pytest.raises(SessionConflictError, match="another process has changed the same session"):
        repository.commit(transactions[1], branch="main", message="second")


def test_sessions_of_a_rig_repeat_freely_and_the_latest_is_resumed(repository: GraspRepository) -> None:
    rig = make_header(seed=None, source="ur10")
    record(repository, rig, [make_attempt(rig, 0)])
    latest = record(repository, rig, [make_attempt(rig, number) for number in range(2)])
    resumed = SessionWriter.resume(repository, rig)
    assert (resumed.session, resumed.next_number) == (latest.session, 2)


def test_resume_refuses_where_nothing_matches(repository: GraspRepository) -> None:
    record(repository, HEADER, [HELD])
    with pytest.raises(SessionNotFoundError, match="seed 7 and this configuration"):
        SessionWriter.resume(repository, make_header(seed=7))


@pytest.mark.parametrize("resumed", [False, True])
def test_commits_across_chunk_boundaries_keep_every_row(repository: GraspRepository, resumed: bool) -> None:
    """Columns hold 256 rows in a chunk; the last chunk is rewritten from memory by each commit."""
    attempts = [make_attempt(HEADER, number) for number in range(5)]
    writer = SessionWriter.begin(repository, HEADER)
    for size in (250, 5, 1, 1, 255, 1):
        if resumed and writer.next_number:
            writer = SessionWriter.resume(repository, HEADER)
        for _ in range(size):
            writer.append(replace(attempts[writer.next_number % 5], number=writer.next_number))
        writer.commit()
    table = GraspDataset.open(str(repository.path)).attempts
    assert table["number"].tolist() == list(range(513))
    assert table["digest"].tolist() == [table["digest"].iloc[number % 5] for number in range(513)]


def test_a_failing_disk_loses_nothing(repository: GraspRepository, monkeypatch: pytest.MonkeyPatch) -> None:
    """The branch moves only once everything it needs is on the disk; the attempts stay with the writer until then."""

    def fail(path: Path) -> None:
        raise StorageError(f"cannot sync {path}")

    writer = SessionWriter.begin(repository, HEADER)
    writer.append(HELD)
    tip = repository.resolve("main")
    with monkeypatch.context() as patch:
        patch.setattr(icechunk_engine, "sync_file_system", fail)
        with pytest.raises(StorageError, match="cannot sync"):
            writer.commit()
    assert repository.resolve("main") == tip
    writer.append(make_attempt(HEADER, 1))
    writer.commit()
    assert len(GraspDataset.open(str(repository.path)).attempts) == 2


def test_a_folder_that_cannot_be_written_is_a_storage_error(repository: GraspRepository) -> None:
    writer = SessionWriter.begin(repository, HEADER)
    writer.append(HELD)
    # A file in the place of a folder stops root too, whom permissions would not.
    manifests = repository.folder / "manifests"
    manifests.write_text("")
    with pytest.raises(StorageError, match="cannot commit to"):
        writer.commit()
    manifests.unlink()
    writer.commit()
    assert len(GraspDataset.open(str(repository.path)).attempts) == 1


def test_a_station_without_objects_can_record(repository: GraspRepository) -> None:
    station = make_station(source="ur10", objects=(), serials=None)
    rig = SessionHeader(station=station, seed=None, objects_per_scene=0, config={})
    attempt = replace(HELD, scene=None, truth_held=None)
    with SessionWriter.begin(repository, rig) as writer:
        identity = writer.append(attempt)
    assert GraspDataset.open(str(repository.path)).attempt(identity).scene is None


def test_a_black_picture_is_not_a_missing_one(repository: GraspRepository) -> None:
    """A chunk of fill values is not stored."""
    black = RgbdFrame(rgb=np.zeros((6, 8, 3), np.uint8), depth=np.zeros((6, 8), np.uint16), pose_base_tool=np.eye(4))
    with SessionWriter.begin(repository, HEADER) as writer:
        identity = writer.append(replace(HELD, overhead=black, pregrasp=black))
    stored = GraspDataset.open(str(repository.path)).frame(identity, "pregrasp")
    np.testing.assert_array_equal(stored.rgb, black.rgb)
    np.testing.assert_array_equal(stored.pose_base_tool, np.eye(4))
