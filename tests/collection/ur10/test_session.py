"""A few cases of the fault matrix (``tests/support/rig_faults.py`` runs all): one of each way in which a fault ends."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from tests.support.emulated_rig import need_ur_rtde, running_rig
from tests.support.rig_faults import Matrix


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
    assert verdict.ending == ending, verdict
