"""Sessions of a rig: interruption, pauses, and a few cases of the fault matrix.

``tests/support/rig_faults.py`` runs the whole matrix; here is one case of each way in which a fault ends.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from tests.support.alarms import listening
from tests.support.emulated_rig import need_ur_rtde, running_rig
from tests.support.rig_faults import Matrix
from tests.support.rig_person import repair

from handsight.collection.collector import CollectSettings
from handsight.collection.errors import DeviceError, DeviceLostError
from handsight.collection.policy import Pregrasp, UniformPolicy
from handsight.collection.ur10.gripper import GripResult
from handsight.collection.ur10.robotiq import Robotiq
from handsight.collection.ur10.session import RigReport, collect_on_rig
from handsight.collection.ur10.station_factory import Ur10StationFactory
from handsight.datasets import GraspDataset, GraspRepository
from handsight.datasets.errors import StorageError
from handsight.datasets.records import GraspAttempt
from handsight.datasets.writing.writer import SessionWriter

DAY_LIMIT_S = 240


@pytest.fixture(scope="module")
def matrix(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Matrix]:
    need_ur_rtde()
    options = ("--generation", "e-series", "--objects", "household-train", "--speed", "8")
    with running_rig(*options, camera=True) as rig, listening() as alarms:
        yield Matrix(rig, tmp_path_factory.mktemp("rig"), alarms)


@pytest.mark.parametrize(
    ("fault", "phase", "ending"),
    [
        ("protective-stop", "descend", "recovered"),
        ("drop", "lift", "recovered"),
        ("emergency-stop", "close", "paused"),
        ("gripper-fault:code=14", "close", "recovered"),
        ("kill-arm", "reach", "recovered"),
        ("disk-full", "shake", "paused"),
        # The one after it shows that the safety system of the one before was restarted.
        ("safety-fault", "reach", "paused"),
        ("safety-violation", "release", "paused"),
        ("in-use+drop", "lift", "paused"),
        ("camera-black:cure=power-cycle", "look", "unharmed"),
    ],
)
def test_a_fault_ends_well(matrix: Matrix, fault: str, phase: str, ending: str) -> None:
    verdict = matrix.run(fault, phase)
    assert verdict.wrong == []
    assert verdict.fired == len(fault.split("+"))
    # On a busy machine a camera may come back too late for the attempt, which is then aborted and the next one is not.
    late = ("recovered",) if fault.startswith("camera") else ()
    assert verdict.ending in (ending, *late), verdict


def collected(factory: Ur10StationFactory, path: Path, attempts: int, **options: Any) -> RigReport:
    return collect_on_rig(
        GraspRepository.open_or_create(path), factory, CollectSettings(attempts=attempts), resume=True, **options
    )


def test_what_cannot_be_kept_pauses_the_rig(matrix: Matrix, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    repair(matrix.rig)
    told: list[GraspAttempt] = []

    def full(writer: SessionWriter) -> None:
        raise StorageError("no space left on device")

    monkeypatch.setattr(SessionWriter, "commit", full)
    report = collected(matrix.factory, tmp_path / "grasps", 1, on_attempt=lambda attempt, _: told.append(attempt))
    assert report.paused == "the attempt cannot be kept: no space left on device"
    assert (report.attempts, told) == (0, [])
    assert report.paused in matrix.alarms.heard[-1]


def test_a_gripper_that_is_lost_right_after_the_recovery_costs_one_attempt(
    matrix: Matrix, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    repair(matrix.rig)
    read, calls = Robotiq.read, 0

    def lost_once(gripper: Robotiq) -> GripResult:
        nonlocal calls
        calls += 1
        if calls == 2:  # The first is the recovery's own.
            raise DeviceLostError("gripper: GET POS: timed out")
        return read(gripper)

    monkeypatch.setattr(Robotiq, "read", lost_once)
    told: list[GraspAttempt] = []
    report = collected(matrix.factory, tmp_path / "grasps", 2, on_attempt=lambda attempt, _: told.append(attempt))
    assert (report.paused, report.attempts) == ("", 2)
    assert [attempt.failure for attempt in told] == ["settle: gripper: GET POS: timed out", ""]


def test_whatever_ends_a_session_is_told(matrix: Matrix, tmp_path: Path) -> None:
    repair(matrix.rig)

    class Broken(UniformPolicy):
        def choose(self, *_: object) -> Pregrasp:
            raise ZeroDivisionError("nobody thought of it")

    with pytest.raises(ZeroDivisionError):
        collect_on_rig(
            GraspRepository.open_or_create(tmp_path / "grasps"),
            matrix.factory,
            CollectSettings(attempts=1, policy=Broken()),
        )
    assert "ZeroDivisionError: nobody thought of it" in matrix.alarms.heard[-1]


@pytest.mark.parametrize("resume", [False, True])
def test_that_a_session_cannot_go_on_is_told_as_a_service_may_have_tried(
    matrix: Matrix, tmp_path: Path, *, resume: bool
) -> None:
    rig = matrix.factory.rig
    absent = replace(matrix.factory, rig=replace(rig, camera=replace(rig.camera, address="127.0.0.251")))
    repository = GraspRepository.open_or_create(tmp_path / "grasps")
    heard = len(matrix.alarms.heard)
    with pytest.raises(DeviceError, match="camera") as found:
        collect_on_rig(repository, absent, CollectSettings(attempts=1), resume=resume)
    told = [f"handsight rig {rig.robot.address} cannot begin: {found.value}"] if resume else []
    assert matrix.alarms.heard[heard:] == told


def test_what_was_told_of_is_kept_and_the_session_goes_on_behind_it(matrix: Matrix, tmp_path: Path) -> None:
    repair(matrix.rig)

    def interrupt(attempt: GraspAttempt, held: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        collected(matrix.factory, tmp_path / "grasps", 3, on_attempt=interrupt)
    assert len(GraspDataset.open(str(tmp_path / "grasps")).attempts) == 1
    report = collected(matrix.factory, tmp_path / "grasps", 2)
    assert (report.resumed_from, report.attempts, report.paused) == (1, 2, "")
    dataset = GraspDataset.open(str(tmp_path / "grasps"))
    (session,) = dataset.sessions
    assert session.header.seed is None
    assert session.header.config["station"]["calibration"]["id"] == matrix.factory.calibration.id


def test_a_pause_is_told_to_everybody_and_keeps_the_attempts(matrix: Matrix, tmp_path: Path) -> None:
    repair(matrix.rig)
    rig = matrix.factory.rig
    guards = replace(rig.guards, success_window=1, least_success=1.0, most_aborted=0.0)
    said = tmp_path / "said"
    alarm = replace(rig.alarm, command=("/bin/sh", "-c", f'echo "$0" > {said}'))
    watched = replace(matrix.factory, rig=replace(rig, guards=guards, alarm=alarm, heartbeat=tmp_path / "heartbeat"))
    report = collected(watched, tmp_path / "grasps", 40)
    assert report.paused.startswith("0.0% of the last 1 grasp succeeded")
    assert report.attempts == len(GraspDataset.open(str(tmp_path / "grasps")).attempts)
    assert report.paused in said.read_text(encoding="utf-8")
    assert '"state": "paused"' in (tmp_path / "heartbeat").read_text(encoding="utf-8")


def day(folder: Path, *options: str) -> dict[str, Any]:
    """What ``tests/support/rig_day.py`` reports."""
    program = Path(__file__).parents[2] / "support" / "rig_day.py"
    command = [sys.executable, str(program), str(folder), "--speed", "20", "--faults-per-hour", "120", *options]
    done = subprocess.run(command, capture_output=True, text=True, timeout=DAY_LIMIT_S, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def test_an_unattended_run_loses_nothing_and_goes_on_where_it_was_left(tmp_path: Path) -> None:
    need_ur_rtde()
    first, second = (day(tmp_path / "day", "--hours", hours) for hours in ("0.1", "0.2"))
    assert (first["wrong"], second["wrong"]) == ([], [])
    assert second["robot_hours"] >= 0.2 > first["robot_hours"] >= 0.1
    assert second["lives_of_the_emulator"] > first["lives_of_the_emulator"]
    assert second["kept"] >= second["attempts"] >= first["attempts"]
    assert sum(second["faults_of_the_rig"].values()) > 0
