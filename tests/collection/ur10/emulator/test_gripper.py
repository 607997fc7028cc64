"""The Robotiq socket: variables, activation, and what OBJ says about what the jaws met."""

from __future__ import annotations

import pytest
from tests.support.bare_rig import let_pass, robotiq

from handsight.collection.ur10.emulator.rig import EmulatedRig
from handsight.collection.ur10.emulator.world import BareWorld


def activate(rig: EmulatedRig) -> None:
    assert robotiq(rig).answer("SET ACT 1\n") == b"ack"
    let_pass(rig, 2.0)
    assert value(rig, "STA") == 3


def value(rig: EmulatedRig, name: str) -> int:
    said, text = robotiq(rig).answer(f"GET {name}\n").split()
    assert said.decode() == name
    return int(text)


def move(rig: EmulatedRig, position: int) -> tuple[int, int]:
    assert robotiq(rig).answer(f"SET POS {position} SPE 255 FOR 50 GTO 1\n") == b"ack"
    assert value(rig, "PRE") == position
    let_pass(rig, 2.0)
    return value(rig, "POS"), value(rig, "OBJ")


def test_nothing_moves_before_activation(e_series: EmulatedRig) -> None:
    assert (value(e_series, "ACT"), value(e_series, "STA")) == (0, 0)
    move(e_series, 255)
    assert value(e_series, "POS") == 0
    activate(e_series)
    assert move(e_series, 255)[0] == 228


@pytest.mark.parametrize(("held_m", "expected"), [(0.0, (228, 3)), (0.03, (148, 2)), (0.0006, (226, 2))])
def test_closing_tells_what_is_between_the_jaws(
    e_series: EmulatedRig, held_m: float, expected: tuple[int, int]
) -> None:
    activate(e_series)
    world = e_series.world
    assert isinstance(world, BareWorld)
    world.held_m = held_m
    assert move(e_series, 255) == expected
    assert move(e_series, 0) == (0, 3)


def test_object_that_slips_out_lets_the_jaws_go_on(e_series: EmulatedRig) -> None:
    activate(e_series)
    world = e_series.world
    assert isinstance(world, BareWorld)
    world.held_m = 0.03
    assert move(e_series, 255) == (148, 2)
    assert world.slip()
    let_pass(e_series, 1.0)
    assert (value(e_series, "POS"), value(e_series, "OBJ")) == (228, 3)


def test_position_between_open_and_closed_is_reached(e_series: EmulatedRig) -> None:
    activate(e_series)
    position, obj = move(e_series, 100)
    assert (abs(position - 100) <= 2, obj) == (True, 3)


def test_major_fault_ends_motion_until_it_is_activated_anew(e_series: EmulatedRig) -> None:
    activate(e_series)
    e_series.gripper.fail(0x0E)
    move(e_series, 255)
    assert (value(e_series, "FLT"), value(e_series, "POS")) == (14, 0)
    robotiq(e_series).answer("SET ACT 0\n")
    activate(e_series)
    assert value(e_series, "FLT") == 0
    assert move(e_series, 255)[0] == 228


@pytest.mark.parametrize("line", ["GET XYZ", "SET POS 300", "SET POS", "SET FLT 0", "hello"])
def test_what_it_does_not_know_is_answered_with_a_question_mark(e_series: EmulatedRig, line: str) -> None:
    assert robotiq(e_series).answer(line) == b"?\n"


def test_emergency_stop_leaves_a_question_mark(e_series: EmulatedRig) -> None:
    e_series.robot.machine.emergency_stop()
    assert robotiq(e_series).answer("GET POS") == b"?\n"
