"""The grippers' own protocols, against servers that answer as the devices do, traps included."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from tests.support.line_server import answering

from handsight.collection.errors import DeviceError, DeviceLostError
from handsight.collection.ur10.gripper import Gripper, gripper_for
from handsight.collection.ur10.onrobot import Rg2
from handsight.collection.ur10.rig import GripperConfig
from handsight.collection.ur10.robotiq import Robotiq

CONFIG = GripperConfig(
    kind="robotiq",
    address="127.0.0.1",
    model="2f-85",
    stroke_m=0.085,
    closed_width_m=0.0012,
    open_count=3,
    closed_count=228,
    timeout_s=1.0,
)


class Urcap:
    """A Robotiq gripper behind its URCap: moves arrive at once, and stop at ``thing``."""

    def __init__(self, *, thing: int = 228, object_felt: int | None = None, **values: int) -> None:
        self.thing = thing
        self.felt = object_felt
        self.values = {"ACT": 1, "GTO": 0, "STA": 3, "FLT": 0, "POS": 3, "PRE": 3, "OBJ": 3, "SID": 9, **values}
        self.lines: list[str] = []

    def answer(self, got: bytes) -> bytes:
        said = b""
        for line in got.decode().splitlines():
            self.lines.append(line)
            words = line.split()
            if words[0] == "GET":
                said += f"{words[1]} {self.values[words[1]]}\n".encode()
                continue
            self._set(dict(zip(words[1::2], map(int, words[2::2]), strict=True)))
            said += b"ack"  # Three bytes, no newline.
        return said

    def _set(self, values: dict[str, int]) -> None:
        self.values.update({name: value for name, value in values.items() if name != "POS"})
        if values.get("ACT") == 0:
            self.values["STA"] = 0
        elif values.get("ACT") == 1:
            self.values.update(STA=3, FLT=0)
        if "POS" in values:
            self.values["PRE"] = values["POS"]
            reached = min(values["POS"], self.thing)
            stopped = reached < min(values["POS"], 228)
            self.values["POS"] = max(reached, 3)
            self.values["OBJ"] = 2 if stopped else 3
            if self.felt is not None and values["POS"] > 100:
                self.values["OBJ"] = self.felt


def robotiq(urcap: Urcap, use: Callable[[Robotiq], None], **changes: Any) -> None:
    with answering(urcap.answer) as (_, port):
        gripper = Robotiq(replace(CONFIG, port=port, **changes))
        try:
            use(gripper)
        finally:
            gripper.disconnect()


@pytest.mark.parametrize(
    ("thing", "felt", "width_m", "detected"),
    [
        (228, None, 0.0, False),  # Nothing between the pads.
        (180, None, 0.085 * 48 / 225, True),
        (226, 2, 1.01 * 0.0012, True),  # A sheet that the position cannot tell from nothing, and OBJ can.
        (227, 3, 0.0, False),
        (223, 3, 0.085 * 5 / 225, False),  # Wide enough for the position alone.
    ],
)
def test_a_robotiq_tells_an_object_by_position_or_by_what_it_feels(
    thing: int, felt: int | None, width_m: float, detected: bool
) -> None:
    def use(gripper: Robotiq) -> None:
        gripper.connect()
        result = gripper.close()
        assert result.width_m == pytest.approx(width_m)
        assert result.object_detected is detected
        assert result.raw["POS"] == min(thing, 228)

    robotiq(Urcap(thing=thing, object_felt=felt), use)


def test_an_active_robotiq_is_not_activated_again() -> None:
    urcap = Urcap()
    robotiq(urcap, lambda gripper: gripper.connect())
    assert not any(line.startswith("SET") for line in urcap.lines)


@pytest.mark.parametrize("values", [{"STA": 0, "ACT": 0}, {"FLT": 7}, {"FLT": 14}])
def test_a_robotiq_that_is_not_ready_is_reset_and_activated(values: dict[str, int]) -> None:
    urcap = Urcap(**values)
    robotiq(urcap, lambda gripper: gripper.connect())
    assert [line for line in urcap.lines if line.startswith("SET")] == ["SET ACT 0 ATR 0", "SET ACT 1"]


def looked_at(gripper: Robotiq) -> None:
    assert gripper.probe()["FLT"] == 14


def test_a_look_at_a_robotiq_sets_nothing() -> None:
    urcap = Urcap(FLT=14, STA=0)
    robotiq(urcap, looked_at)
    assert not any(line.startswith("SET") for line in urcap.lines)


def test_a_fault_and_an_emergency_stop_are_told() -> None:
    def use(gripper: Robotiq) -> None:
        gripper.connect()
        urcap.values["FLT"] = 14
        with pytest.raises(DeviceError, match="fault 14: overcurrent"):
            gripper.read()

    urcap = Urcap()
    robotiq(urcap, use)
    with answering(lambda got: b"?\n") as (_, port), pytest.raises(DeviceError, match="emergency stop"):
        Robotiq(replace(CONFIG, port=port)).connect()


def test_jaws_that_do_not_open_are_told() -> None:
    class Stuck(Urcap):
        def _set(self, values: dict[str, int]) -> None:
            super()._set(values)
            self.values["POS"] = 120

    def use(gripper: Robotiq) -> None:
        gripper.connect()
        with pytest.raises(DeviceError, match="opened to 120 counts only, expected 3"):
            gripper.open()

    robotiq(Stuck(), use)


def test_jaws_that_never_stand_are_given_up() -> None:
    def use(gripper: Robotiq) -> None:
        gripper.connect()
        with pytest.raises(DeviceError, match="waited too long for the jaws to stand"):
            gripper.close()

    robotiq(Urcap(object_felt=0), use, timeout_s=0.3)


def test_a_gripper_that_hangs_up_is_lost() -> None:
    with answering(lambda got: None) as (_, port), pytest.raises(DeviceLostError, match="GET SID"):
        Robotiq(replace(CONFIG, port=port)).connect()


class ComputeBox:
    """An RG2's registers over Modbus TCP; the jaws stop at ``thing`` [0.1 mm]."""

    def __init__(self, thing: int = 0, status: int = 0) -> None:
        self.thing, self.width, self.status = thing, 850, status
        self.force = 0

    def answer(self, got: bytes) -> bytes:
        number, _, _, unit = struct.unpack(">HHHB", got[:7])
        body = got[7:]
        function, first, count = struct.unpack(">BHH", body[:5])
        if unit != 65:
            said = bytes((function | 0x80, 2))
        elif function == 16:
            self.force, wanted, _ = struct.unpack(">3H", body[6:])
            self.width = max(wanted, self.thing)
            self.status = 0b10 if self.width > wanted else 0
            said = body[:5]
        else:
            values = {267: self.width, 268: self.status}
            said = struct.pack(f">BB{count}H", 3, 2 * count, *(values[first + i] for i in range(count)))
        return struct.pack(">HHHB", number, 0, len(said) + 1, unit) + said


RG2 = replace(CONFIG, kind="rg2", model="rg2", open_count=850, closed_count=0, margin_counts=10)


@pytest.mark.parametrize(("thing", "width_m", "detected"), [(0, 0.0, False), (300, 0.03, True), (5, 0.001212, True)])
def test_an_rg2_tells_an_object(thing: int, width_m: float, detected: bool) -> None:
    box = ComputeBox(thing)
    with answering(box.answer) as (_, port):
        gripper = Rg2(replace(RG2, port=port))
        gripper.connect()
        gripper.open()
        result = gripper.close()
        gripper.disconnect()
    assert result.width_m == pytest.approx(width_m)
    assert result.object_detected is detected
    assert box.force == 80


def test_an_rg2_with_a_pressed_safety_switch_is_told() -> None:
    with answering(ComputeBox(status=0b100).answer) as (_, port), pytest.raises(DeviceError, match="safety switch"):
        Rg2(replace(RG2, port=port)).connect()


def test_the_driver_follows_the_rig() -> None:
    drivers: list[Gripper] = [gripper_for(CONFIG), gripper_for(RG2)]
    assert [type(one) for one in drivers] == [Robotiq, Rg2]
