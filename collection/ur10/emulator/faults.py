"""What goes wrong in the emulated rig, now or when a moment of the cycle comes.

A fault is written ``NAME[:KEY=VALUE,...][@WHEN]``: ``protective-stop@descend``, ``gripper-fault:code=14@close``,
``force-noise:n=15``, ``drop@z<0.05``. ``WHEN`` is a phase, ``z<METRES``, ``z>METRES``, ``force>NEWTONS`` or
``t>SECONDS`` of the robot's clock.

Phases are told from what arm and jaws do: ``descend`` is a motion straight down with open jaws, ``reach`` any other one
with open jaws, ``close`` and ``release`` the jaws' own motion, ``lift`` up and ``shake`` any other motion with closed
jaws, ``look`` a picture asked for while the arm stands, ``rest`` all else.
"""

from __future__ import annotations

import asyncio
import math
import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING

from handsight.collection.ur10.emulator.errors import FaultError
from handsight.collection.ur10.emulator.machine import Machine, Runtime

if TYPE_CHECKING:
    from handsight.collection.ur10.emulator.rig import EmulatedRig

PHASES = ("rest", "look", "reach", "descend", "close", "lift", "shake", "release")
VERTICAL_M_S = 0.008
"""A tool that moves up or down at less is not lifted or lowered."""
SIDEWAYS_SHARE = 0.1
"""A tool that goes down and sideways beyond so much of it is on its way to where it descends."""
MOVING_M_S = 0.002
LOOK_S = 0.3
"""A picture is being taken for so long after it was asked for."""
SLIP = "slip"
_CONDITION = re.compile(r"(z|force|t)\s*([<>])\s*(-?[0-9.]+)")
KILLED = 9
"""Exit status of a process that a fault kills."""


@dataclass(frozen=True, slots=True)
class Fault:
    """One thing that goes wrong."""

    name: str
    values: Mapping[str, str] = field(default_factory=dict)
    when: str = ""
    """Phase or condition; empty for at once."""

    @classmethod
    def parse(cls, text: str) -> Fault:
        """Read one as it is written.

        Raises:
            FaultError: There is no such fault, value or moment.
        """
        head, _, when = text.partition("@")
        name, _, listed = head.partition(":")
        values: dict[str, str] = {}
        for pair in filter(None, listed.split(",")):
            key, equals, value = pair.partition("=")
            if not equals:
                raise FaultError(f"fault {text!r} has {pair!r}, expected KEY=VALUE")
            values[key.strip()] = value.strip()
        fault = cls(name.strip(), values, when.strip())
        fault.check()
        return fault

    def check(self) -> None:
        """Refuse what does not exist.

        Raises:
            FaultError: There is no such fault, value or moment.
        """
        faults = []
        if self.name not in ACTIONS:
            faults.append(f"fault is {self.name!r}, expected one of {', '.join(ACTIONS)}")
        else:
            known = ACTIONS[self.name][1]
            faults += [
                f"{self.name} has the value {key!r}, expected {', '.join(known) or 'none'}"
                for key in self.values
                if key not in known
            ]
            faults += [
                f"{key} of {self.name} is {value!r}, expected a number"
                for key, value in self.values.items()
                if key in known and isinstance(known[key], float) and not _is_number(value)
            ]
        if self.when and self.when not in PHASES and not _CONDITION.fullmatch(self.when):
            faults.append(
                f"moment of {self.name} is {self.when!r}, expected one of {', '.join(PHASES)}, or z<M, "
                "z>M, force>N, t>S"
            )
        if faults:
            raise FaultError("; ".join(faults))

    def number(self, key: str) -> float:
        """One of its values, or what it is unless given."""
        return float(self.values.get(key, ACTIONS[self.name][1][key]))

    def text(self, key: str) -> str:
        """As :meth:`number`, for words."""
        return str(self.values.get(key, ACTIONS[self.name][1][key]))


@dataclass(frozen=True, slots=True, kw_only=True)
class Fired:
    """A fault that has happened."""

    name: str
    clock_s: float
    phase: str


class Faults:
    """Faults that wait for their moment."""

    def __init__(self, rig: EmulatedRig) -> None:
        self._rig = rig
        self.armed: list[Fault] = []
        self.fired: list[Fired] = []
        self._asked = 0
        self._looking_until_s = 0.0

    def arm(self, fault: Fault) -> None:
        """Have it happen at its moment, or now."""
        if fault.when:
            self.armed.append(fault)
        else:
            self._fire(fault)

    def tick(self) -> None:
        """Let happen what is due."""
        self._watch_camera()
        if not self.armed:
            return
        phase = self.phase()
        for fault in [fault for fault in self.armed if self._due(fault, phase)]:
            if fault.name == SLIP and not self._rig.world.holds:
                continue  # There is nothing to lose yet.
            self.armed.remove(fault)
            self._fire(fault, phase)

    def clear(self) -> None:
        """Disarm everything and undo what lasts."""
        self.armed.clear()
        rig = self._rig
        rig.robot.sensor.calm()
        rig.robot.machine.remote = True
        rig.robot.overheated_joint = None
        rig.rtde.taken.clear()
        rig.gripper.fault, rig.gripper.silent = 0, False
        if rig.camera is not None:
            rig.network.keep(rig.camera.repair("power-cycle"))

    def phase(self) -> str:
        """What the rig does now."""
        robot, gripper = self._rig.robot, self._rig.gripper
        speed_m_s = robot.tool_speed_m_s
        if gripper.moving:
            return "close" if gripper.closing else "release"
        if robot.motion is None or max(map(abs, speed_m_s)) < MOVING_M_S:
            return "look" if robot.clock_s < self._looking_until_s else "rest"
        if gripper.closed:
            return "lift" if speed_m_s[2] > VERTICAL_M_S else "shake"
        sideways_m_s = math.hypot(*speed_m_s[:2])
        straight = sideways_m_s < SIDEWAYS_SHARE * abs(speed_m_s[2])
        return "descend" if speed_m_s[2] < -VERTICAL_M_S and straight else "reach"

    def _watch_camera(self) -> None:
        asked = self._rig.camera.asked if self._rig.camera is not None else 0
        if asked != self._asked:
            self._asked, self._looking_until_s = asked, self._rig.robot.clock_s + LOOK_S

    def _due(self, fault: Fault, phase: str) -> bool:
        found = _CONDITION.fullmatch(fault.when)
        if found is None:
            return phase == fault.when
        robot = self._rig.robot
        values = {"z": robot.tip_z_m, "force": abs(float(robot.sensor.contact_n[2])), "t": robot.clock_s}
        value, limit = values[found[1]], float(found[3])
        return value < limit if found[2] == "<" else value > limit

    def _fire(self, fault: Fault, phase: str = "") -> None:
        ACTIONS[fault.name][0](self._rig, fault)
        self.fired.append(Fired(name=fault.name, clock_s=self._rig.robot.clock_s, phase=phase or self.phase()))


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _drop(rig: EmulatedRig, fault: Fault) -> None:
    rig.network.drop()


def _freeze(rig: EmulatedRig, fault: Fault) -> None:
    rig.network.freeze(fault.number("s"))


def _kill_controller(rig: EmulatedRig, fault: Fault) -> None:
    """The controller's own process dies and comes back: without power, without a program."""
    rig.robot.reboot()
    rig.gripper.reset()
    rig.network.keep(rig.network.vanish(fault.number("s")))


def _exit(rig: EmulatedRig, fault: Fault) -> None:
    os._exit(KILLED)


def _protective(rig: EmulatedRig, fault: Fault) -> None:
    rig.robot.protective_stop(fault.text("cause"))


def _machine(change: Callable[[Machine], None]) -> Callable[[EmulatedRig, Fault], None]:
    def act(rig: EmulatedRig, fault: Fault) -> None:
        change(rig.robot.machine)
        if rig.robot.machine.runtime is Runtime.STOPPED:
            rig.robot.stop_program()

    return act


def _force_noise(rig: EmulatedRig, fault: Fault) -> None:
    rig.robot.sensor.extra_noise_n = fault.number("n")


def _force_drift(rig: EmulatedRig, fault: Fault) -> None:
    rig.robot.sensor.drift_n_s = fault.number("n_s")


def _in_use(rig: EmulatedRig, fault: Fault) -> None:
    first = int(fault.number("first"))
    rig.rtde.taken.update(f"input_{kind}_register_{first}" for kind in ("int", "double"))


def _remote_off(rig: EmulatedRig, fault: Fault) -> None:
    rig.robot.machine.remote = False


def _gripper_fault(rig: EmulatedRig, fault: Fault) -> None:
    rig.gripper.fail(int(fault.number("code")))


def _gripper_silent(rig: EmulatedRig, fault: Fault) -> None:
    rig.gripper.silent = True
    if fault.number("s") > 0:
        asyncio.get_running_loop().call_later(fault.number("s"), rig.gripper.speak)


def _gripper_reset(rig: EmulatedRig, fault: Fault) -> None:
    rig.gripper.reset()


def _slip(rig: EmulatedRig, fault: Fault) -> None:
    rig.world.slip()


def _hot(rig: EmulatedRig, fault: Fault) -> None:
    rig.robot.overheated_joint = int(fault.number("joint"))


def _camera(kind: str) -> Callable[[EmulatedRig, Fault], None]:
    def act(rig: EmulatedRig, fault: Fault) -> None:
        if rig.camera is None:
            raise FaultError(f"camera-{kind}: this rig has no camera, start the emulator with --camera")
        rig.camera.break_down(kind, fault.text("cure"))

    return act


ACTIONS: dict[str, tuple[Callable[[EmulatedRig, Fault], None], dict[str, float | str]]] = {
    "drop": (_drop, {}),
    "freeze": (_freeze, {"s": 5.0}),
    "kill-controller": (_kill_controller, {"s": 3.0}),
    "exit": (_exit, {}),
    "protective-stop": (_protective, {"cause": "C204: path sanity check failed"}),
    "emergency-stop": (_machine(Machine.emergency_stop), {}),
    "system-emergency-stop": (_machine(partial(Machine.emergency_stop, system=True)), {}),
    "safeguard-stop": (_machine(Machine.safeguard_stop), {}),
    "safety-fault": (_machine(Machine.fault), {}),
    "safety-violation": (_machine(partial(Machine.fault, violation=True)), {}),
    "force-noise": (_force_noise, {"n": 10.0}),
    "force-drift": (_force_drift, {"n_s": 1.0}),
    "in-use": (_in_use, {"first": 0.0}),
    "remote-off": (_remote_off, {}),
    "gripper-fault": (_gripper_fault, {"code": 8.0}),
    "gripper-silent": (_gripper_silent, {"s": 0.0}),
    "gripper-reset": (_gripper_reset, {}),
    SLIP: (_slip, {}),
    "joint-hot": (_hot, {"joint": 3.0}),
    **{
        f"camera-{kind}": (_camera(kind), {"cure": "restart"})
        for kind in ("dropout", "frozen", "stale", "black", "no-depth", "unplugged")
    },
}
"""What each fault does, and its values with what they are unless given."""
