"""Faults at random: as many as asked for, the same from the same seed, all of them real ones."""

from __future__ import annotations

import pytest

from handsight.collection.ur10.emulator.chaos import DRAWN, Chaos
from handsight.collection.ur10.emulator.faults import Fault


def drawn(seed: int, *, hours: int = 20, per_hour: float = 30) -> list[Fault]:
    faults: list[Fault] = []
    chaos = Chaos(per_hour, seed, faults.append)
    for second in range(3600 * hours):
        chaos.tick(float(second))
    return faults


def test_as_many_as_asked_for_and_every_kind() -> None:
    faults = drawn(1)
    assert len(faults) == pytest.approx(600, rel=0.2)
    assert {fault.name for fault in faults} == set(DRAWN)


def test_all_of_them_exist() -> None:
    for fault in drawn(2):
        fault.check()


def test_no_gripper_is_overheated_for_which_a_rig_would_pause() -> None:
    assert {fault.values["code"] for fault in drawn(2) if fault.name == "gripper-fault"} == {"5", "10", "14"}


def test_seed_decides() -> None:
    assert drawn(3) == drawn(3)
    assert drawn(3) != drawn(4)
