"""A Robotiq two-finger gripper behind its URCap's socket, port 63352 of the robot's address.

Positions are counts: 0 is open, 228 mechanically closed, whatever is asked for. What stops the jaws before decides
OBJ: 1 while opening, 2 while closing; an object that leaves the grip lets them go on to 3.
"""

from __future__ import annotations

import asyncio

from handsight.collection.ur10.emulator.controller import Controller
from handsight.collection.ur10.emulator.machine import EMERGENCIES
from handsight.collection.ur10.emulator.network import Network
from handsight.collection.ur10.emulator.world import World

PORT = 63352
CLOSED_COUNT = 228
SLOWEST_M_S, FASTEST_M_S = 0.020, 0.150
"""Speed of the jaws against each other at SPE 0 and 255 (manual of the 2F-85)."""
ACTIVATION_S = 1.5
STALLED_M_S = 0.004
STALLED_S = 0.06
"""Jaws slower than this for so long have met something."""
EMPTY_COUNT = 227
"""From here on nothing is between the pads."""
ARRIVED_COUNTS = 1.5
MAJOR_FAULT = 8
READABLE = ("ACT", "GTO", "ATR", "ARD", "FOR", "SPE", "POS", "PRE", "OBJ", "STA", "FLT", "COU", "SID")
WRITABLE = ("ACT", "GTO", "ATR", "ARD", "FOR", "SPE", "POS")


class Gripper:
    """The gripper of one rig."""

    def __init__(self, robot: Controller, world: World, network: Network) -> None:
        """Serve on the port, once the network opens; the gripper is not activated."""
        self._robot = robot
        self._world = world
        self._network = network
        self._values = dict.fromkeys(WRITABLE, 0)
        self._values.update(SPE=255, FOR=0)
        self._target = 0
        self._direction = 0
        self._object = 3
        self._stalled_s = 0.0
        self._activating_s: float | None = None
        self.fault = 0
        """FLT: what the gripper says is wrong with it."""
        self.silent = False
        """Fault: no answer at all."""
        network.serve(PORT, self._connected)

    @property
    def count(self) -> int:
        """Measured position."""
        share = 1.0 - self._world.width_m / self._world.stroke_m
        return min(max(round(CLOSED_COUNT * share), 0), CLOSED_COUNT)

    @property
    def closing(self) -> bool:
        """Whether the jaws are on their way together."""
        return self._direction > 0 and self._object == 0

    @property
    def moving(self) -> bool:
        """Whether the jaws are under way."""
        return self._direction != 0 and self._object == 0

    @property
    def closed(self) -> bool:
        """Whether the jaws were last sent together, and got there or were stopped."""
        return self._direction > 0 and self._object != 0

    def fail(self, code: int) -> None:
        """Report a fault, and from 8 on, the major ones, move no more until it is activated anew."""
        self.fault = code
        if code >= MAJOR_FAULT:
            self._world.drive_jaws(0.0)

    def speak(self) -> None:
        """Answer again."""
        self.silent = False

    @property
    def _status(self) -> int:
        if not self._values["ACT"]:
            return 0
        return 3 if self._activating_s is None else 1

    def tick(self, seconds: float) -> None:
        """One period."""
        if self._activating_s is not None:
            self._activating_s -= seconds
            if self._activating_s <= 0:
                self._activating_s = None
                self._world.drive_jaws(0.0)
                self._target, self._object = 0, 3
            return
        if self._direction == 0:
            return
        here = self.count
        slow = self._world.jaw_speed_m_s < STALLED_M_S
        self._stalled_s = self._stalled_s + seconds if slow else 0.0
        if self._object == 0:
            self._watch_move(here)
        elif self._object == 2 and here >= EMPTY_COUNT:
            self._object = 3  # It slipped out, and the pads met.

    def _watch_move(self, here: int) -> None:
        short = (self._target - here) * self._direction
        if short < ARRIVED_COUNTS:
            self._object = 3
            if 0 < self._target < CLOSED_COUNT:
                self._world.drive_jaws(0.0)  # At its ends the jaws go on to the stop.
        elif self._stalled_s >= STALLED_S:
            if self._direction > 0:
                # The motor goes on pressing: what slips out lets the jaws go on.
                self._object = 3 if here >= EMPTY_COUNT else 2
            else:
                self._object = 3 if here <= ARRIVED_COUNTS else 1

    def _move(self) -> None:
        if not (self._values["ACT"] and self._values["GTO"]) or self._status != 3 or self.fault >= MAJOR_FAULT:
            return
        here = self.count
        at_end = not 0 < self._target < CLOSED_COUNT
        if abs(self._target - here) < ARRIVED_COUNTS and not at_end:
            self._object = 3
            return
        # To its ends it is driven even from there: wide open jaws may still press on what they held.
        opens = self._target < here or self._target <= 0
        self._direction = -1 if opens else 1
        self._object, self._stalled_s = 0, 0.0
        share = self._values["SPE"] / 255
        speed_m_s = SLOWEST_M_S + share * (FASTEST_M_S - SLOWEST_M_S)
        self._world.drive_jaws(-self._direction * speed_m_s)

    def reset(self) -> None:
        """Loses its power: needs activation."""
        self._values.update(ACT=0, GTO=0)
        self._activating_s, self._direction, self._object = None, 0, 3
        self._world.drive_jaws(0.0)

    def set(self, name: str, value: int) -> None:
        """Write one variable."""
        before = self._values[name]
        self._values[name] = value
        if name == "ACT" and value != before:
            if value:
                self._activating_s, self.fault = ACTIVATION_S, 0
                # It opens and closes to find its ends; what it held falls.
                self._world.drive_jaws(FASTEST_M_S)
            else:
                self.reset()
        elif name == "POS":
            self._target = value
            self._move()
        elif name == "GTO" and value and not before:
            self._move()

    def get(self, name: str) -> int:
        """Read one variable."""
        measured = {
            "POS": self.count,
            "PRE": self._target,
            "OBJ": self._object if self._status == 3 else 0,
            "STA": self._status,
            "FLT": self.fault,
            "COU": 40 if self._object == 0 else 3,
            "SID": 9,
        }
        return measured[name] if name in measured else self._values[name]

    async def _connected(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        while line := await reader.readline():
            await self._network.thawed()
            answer = self.answer(line.decode("ascii", errors="replace"))
            if answer and not self.silent:
                self._network.send(writer, answer)

    def answer(self, line: str) -> bytes:
        """What the URCap says to a line; an acknowledgement is three bytes without a newline."""
        words = line.split()
        if not words:
            return b""
        if self._robot.machine.safety in EMERGENCIES:
            return b"?\n"
        if words[0] == "GET" and len(words) == 2 and words[1] in READABLE:
            return f"{words[1]} {self.get(words[1])}\n".encode()
        if words[0] == "SET" and len(words) % 2 == 1:
            pairs = list(zip(words[1::2], words[2::2], strict=True))
            if all(name in WRITABLE and text.isdigit() and int(text) <= 255 for name, text in pairs):
                # As the URCap does: all are written, then the gripper acts on them.
                for name, text in sorted(pairs, key=lambda pair: pair[0] == "POS"):
                    self.set(name, int(text))
                return b"ack"
        return b"?\n"
