"""Sessions of a rig: interruption, pauses, and a few cases of the fault matrix.

``tests/support/rig_faults.py`` runs the whole matrix; here is one case of each way in which a fault ends.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from tests.support.emulated_rig import need_ur_rtde, running_rig
from tests.support.rig_faults import Matrix

from handsight.collection.collector import CollectSettings
from handsight.collection.ur10.session import RigReport, collect_on_rig
from handsight.collection.ur10.station import Ur10StationFactory
from handsight.datasets import GraspDataset, GraspRepository
from handsight.datasets.records import GraspAttempt


@pytest.fixture(scope="module")
def matrix(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Matrix]:
    need_ur_rtde()
    options = ("--generation", "e-series", "--objects", "household-train", "--speed", "8")
    with running_rig(*options, camera=True) as rig:
        yield Matrix(rig, tmp_path_factory.mktemp("rig"))


@pytest.mark.parametrize(
    ("fault", "phase", "ending"),
    [
        ("protective-stop", "descend", "recovered"),
        ("drop", "lift", "recovered"),
        ("emergency-stop", "close", "paused"),
        ("gripper-fault:code=14", "close", "recovered"),
        ("camera-black:cure=power-cycle", "look", "unharmed"),
    ],
)
def test_a_fault_ends_well(matrix: Matrix, fault: str, phase: str, ending: str) -> None:
    verdict = matrix.run(fault, phase)
    assert verdict.wrong == []
    assert verdict.fired == 1
    # On a busy machine a camera may come back too late for the attempt, which is then aborted and the next one is not.
    late = ("recovered",) if fault.startswith("camera") else ()
    assert verdict.ending in (ending, *late), verdict


def collected(factory: Ur10StationFactory, path: Path, attempts: int, **options: Any) -> RigReport:
    return collect_on_rig(
        GraspRepository.open_or_create(path), factory, CollectSettings(attempts=attempts), resume=True, **options
    )


def test_what_was_told_of_is_kept_and_the_session_goes_on_behind_it(matrix: Matrix, tmp_path: Path) -> None:
    matrix.rig.do("clear")
    matrix.rig.do("release")

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
    matrix.rig.do("clear")
    matrix.rig.do("release")
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
