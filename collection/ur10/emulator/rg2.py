"""An OnRobot RG2 behind its Compute Box: holding registers over Modbus TCP, unit 65.

Written: 0 force [0.1 N], 1 width [0.1 mm], 2 control (1 grip, 8 stop, 16 grip with the fingertips' offset). Read: 258
that offset, 267 width, 275 width with it, 268 status (bit 0 busy, bit 1 grip detected, bits 2 to 6 safety switches).
"""

from __future__ import annotations

import asyncio
import struct

from handsight.collection.ur10.emulator.network import Network
from handsight.collection.ur10.emulator.world import World

PORT, UNIT = 502, 65
MOST_WIDTH = 1100
MOST_FORCE = 400
FORCE, WIDTH, CONTROL = 0, 1, 2
OFFSET, WIDTH_READ, STATUS, WIDTH_WITH_OFFSET = 258, 267, 268, 275
GRIP, STOP, GRIP_WITH_OFFSET = 1, 8, 16
BUSY, DETECTED, SAFETY_SWITCH = 0b1, 0b10, 0b100
SPEED_M_S = 0.11
"""Of the jaws against each other; the data sheet's figure."""
STALLED_M_S, STALLED_S = 0.004, 0.06
ARRIVED_M = 0.0004
DETECTED_M = 0.001
"""What stops the jaws so far before their target is an object."""
M_PER_UNIT = 1e-4
READ_HOLDING, READ_INPUT, WRITE_ONE, WRITE_SEVERAL = 3, 4, 6, 16
NO_FUNCTION, NO_ADDRESS, NO_VALUE = 1, 2, 3
_HEADER = struct.Struct(">HHHB")


class Rg2:
    """The second gripper that a rig can have; its jaws open to 110 mm at most."""

    def __init__(self, world: World, network: Network, port: int = PORT) -> None:
        """Serve on the port, once the network opens."""
        self._world = world
        self._network = network
        self._written = {FORCE: 0, WIDTH: MOST_WIDTH, CONTROL: 0}
        self._direction = 0
        self._detected = False
        self._busy = False
        self._stalled_s = 0.0
        self.fault = 0
        """Safety switches that are pressed, as the status has them."""
        self.silent = False
        """Fault: no answer at all."""
        network.serve(port, self._connected)

    @property
    def moving(self) -> bool:
        """Whether the jaws are under way."""
        return self._busy

    @property
    def closing(self) -> bool:
        """Whether they are on their way together."""
        return self._busy and self._direction < 0

    @property
    def closed(self) -> bool:
        """Whether the jaws were last sent together, and got there or were stopped."""
        return self._direction < 0 and not self._busy

    def fail(self, code: int) -> None:
        """A safety switch is pressed, whatever the code: it moves no more until its power was off."""
        self.fault = SAFETY_SWITCH if code else 0
        self._halt()

    def speak(self) -> None:
        """Answer again."""
        self.silent = False

    def reset(self) -> None:
        """Loses its power, and with it what its switches said."""
        self.fault = 0
        self._halt()

    def get(self, name: str) -> int:
        """What the control port tells, by the names that it has for the other gripper."""
        values = {"POS": self.read(WIDTH_READ) or 0, "OBJ": 2 if self._detected else 3, "STA": 3, "FLT": self.fault}
        return values[name]

    def tick(self, seconds: float) -> None:
        """One period."""
        if not self._direction:
            return
        short_m = (self._target_m - self._world.width_m) * self._direction
        if short_m <= ARRIVED_M:
            self._busy = self._detected = False
            if self._target_m > 0:
                self._world.drive_jaws(0.0)
            return
        if self._busy:
            slow = self._world.jaw_speed_m_s < STALLED_M_S
            self._stalled_s = self._stalled_s + seconds if slow else 0.0
            if self._stalled_s >= STALLED_S:
                self._busy = False
                self._detected = self._direction < 0 and short_m > DETECTED_M

    def read(self, register: int) -> int | None:
        """Value of a holding register; None where there is none."""
        width = min(round(self._world.width_m / M_PER_UNIT), MOST_WIDTH)
        status = (BUSY if self._busy else 0) | (DETECTED if self._detected else 0) | self.fault
        read = {OFFSET: 0, WIDTH_READ: width, STATUS: status, WIDTH_WITH_OFFSET: width}
        return read.get(register, self._written.get(register))

    def write(self, register: int, value: int) -> int:
        """Write a holding register; 0, or the number of the exception."""
        if register not in self._written:
            return NO_ADDRESS
        if value > {FORCE: MOST_FORCE, WIDTH: MOST_WIDTH, CONTROL: GRIP_WITH_OFFSET}[register]:
            return NO_VALUE
        self._written[register] = value
        if register == CONTROL:
            if value in (GRIP, GRIP_WITH_OFFSET):
                self._grip()
            elif value == STOP:
                self._halt()
        return 0

    @property
    def _target_m(self) -> float:
        return self._written[WIDTH] * M_PER_UNIT

    def _grip(self) -> None:
        if self.fault:
            return
        self._direction = 1 if self._target_m > self._world.width_m else -1
        self._busy, self._detected, self._stalled_s = True, False, 0.0
        self._world.drive_jaws(self._direction * SPEED_M_S)

    def _halt(self) -> None:
        self._direction, self._busy, self._detected = 0, False, False
        self._world.drive_jaws(0.0)

    async def _connected(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        while True:
            number, protocol, length, unit = _HEADER.unpack(await reader.readexactly(_HEADER.size))
            request = await reader.readexactly(length - 1)
            await self._network.thawed()
            if self.silent or protocol != 0 or unit != UNIT:
                continue
            answer = self.answer(request)
            self._network.send(writer, _HEADER.pack(number, 0, 1 + len(answer), unit) + answer)

    def answer(self, request: bytes) -> bytes:
        """The answer to a request, without headers."""
        function = request[0]
        try:
            if function in (READ_HOLDING, READ_INPUT):
                return self._answer_read(function, *struct.unpack(">HH", request[1:]))
            if function == WRITE_ONE:
                register, value = struct.unpack(">HH", request[1:])
                fault = self.write(register, value)
                return _refusal(function, fault) if fault else request
            if function == WRITE_SEVERAL:
                first, count, size = struct.unpack_from(">HHB", request, 1)
                values = struct.unpack(f">{count}H", request[6 : 6 + size])
                return self._answer_write(first, values)
        except struct.error:
            return _refusal(function, NO_VALUE)
        return _refusal(function, NO_FUNCTION)

    def _answer_read(self, function: int, first: int, count: int) -> bytes:
        values = [self.read(register) for register in range(first, first + min(count, 125))]
        known = [value for value in values if value is not None]
        if not known or len(known) < len(values):
            return _refusal(function, NO_ADDRESS)
        return struct.pack(f">BB{len(known)}H", function, 2 * len(known), *known)

    def _answer_write(self, first: int, values: tuple[int, ...]) -> bytes:
        for register, value in enumerate(values, start=first):
            fault = self.write(register, value)
            if fault:
                return _refusal(WRITE_SEVERAL, fault)
        return struct.pack(">BHH", WRITE_SEVERAL, first, len(values))


def _refusal(function: int, fault: int) -> bytes:
    return bytes([function | 0x80, fault])
