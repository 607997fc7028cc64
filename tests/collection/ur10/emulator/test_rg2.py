"""The RG2's registers, asked as Modbus frames, and what its status says about what the jaws met."""

from __future__ import annotations

import struct

import pytest

from handsight.collection.ur10.emulator.network import Network
from handsight.collection.ur10.emulator.rg2 import Rg2
from handsight.collection.ur10.emulator.world import BareWorld

PERIOD_S = 0.002
START = BareWorld().joints_rad


@pytest.fixture
def world() -> BareWorld:
    return BareWorld(stroke_m=0.14)


@pytest.fixture
def gripper(world: BareWorld) -> Rg2:
    return Rg2(world, Network("127.0.0.4"))


def read(gripper: Rg2, first: int, count: int = 1) -> list[int]:
    answer = gripper.answer(struct.pack(">BHH", 3, first, count))
    assert answer[:2] == bytes([3, 2 * count])
    return list(struct.unpack(f">{count}H", answer[2:]))


def grip(gripper: Rg2, world: BareWorld, width: int) -> tuple[int, int]:
    """Send a width [0.1 mm] and wait; width and status."""
    request = struct.pack(">BHHB3H", 16, 0, 3, 6, 200, width, 1)
    assert gripper.answer(request) == struct.pack(">BHH", 16, 0, 3)
    assert read(gripper, 268) == [1] or gripper.fault
    for _ in range(1000):
        world.advance(PERIOD_S, START)
        gripper.tick(PERIOD_S)
    width, status = read(gripper, 267, 2)
    return width, status


def test_it_opens_to_where_it_is_sent_and_no_farther(gripper: Rg2, world: BareWorld) -> None:
    assert list(grip(gripper, world, 300)) == [pytest.approx(300, abs=6), 0]
    assert list(grip(gripper, world, 1100)) == [pytest.approx(1100, abs=6), 0]


@pytest.mark.parametrize(("held_m", "expected"), [(0.0, (0, 0)), (0.03, (300, 2))])
def test_status_tells_a_grip_from_nothing(
    gripper: Rg2, world: BareWorld, held_m: float, expected: tuple[int, int]
) -> None:
    world.held_m = held_m
    width, status = grip(gripper, world, 0)
    assert [width, status] == [pytest.approx(expected[0], abs=4), expected[1]]


def test_grip_that_slips_is_no_grip_any_more(gripper: Rg2, world: BareWorld) -> None:
    world.held_m = 0.03
    grip(gripper, world, 0)
    world.slip()
    for _ in range(500):
        world.advance(PERIOD_S, START)
        gripper.tick(PERIOD_S)
    assert read(gripper, 267, 2) == [pytest.approx(0, abs=4), 0]


def test_pressed_safety_switch_ends_motion_until_the_power_was_off(gripper: Rg2, world: BareWorld) -> None:
    grip(gripper, world, 1000)
    gripper.fail(1)
    width, status = grip(gripper, world, 0)
    assert [width, status] == [pytest.approx(1000, abs=6), 4]
    gripper.reset()
    assert grip(gripper, world, 0)[0] == pytest.approx(0, abs=4)


@pytest.mark.parametrize(
    ("request_", "refusal"),
    [
        (struct.pack(">BHH", 3, 500, 1), bytes([0x83, 2])),
        (struct.pack(">BHH", 6, 1, 1101), bytes([0x86, 3])),
        (struct.pack(">BHH", 6, 267, 1), bytes([0x86, 2])),
        (struct.pack(">BHH", 1, 0, 1), bytes([0x81, 1])),
        (b"\x03\x00", bytes([0x83, 3])),
    ],
    ids=["no register", "too wide", "read only", "no function", "cut short"],
)
def test_what_makes_no_sense_is_refused(gripper: Rg2, request_: bytes, refusal: bytes) -> None:
    assert gripper.answer(request_) == refusal
