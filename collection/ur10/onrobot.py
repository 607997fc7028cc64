"""OnRobot RG2 behind its Compute Box, Modbus TCP port 502, unit 65.

Registers: 0 target force [0.1 N], 1 target width [0.1 mm], 2 control (1 grip, 8 stop); 267 width [0.1 mm], 268 status
(bit 0 busy, bit 1 grip detected, bits 2 to 6 safety switches).
"""

from __future__ import annotations

import time

from handsight.collection.errors import DeviceError, DeviceLostError
from handsight.collection.ur10.gripper import GripResult
from handsight.collection.ur10.modbus import Modbus
from handsight.collection.ur10.rig import GripperConfig

PORT, UNIT = 502, 65
ANSWER_S = 2.0
POLL_S = 0.02
GREATEST_FORCE_DN = 400
FORCE, WIDTH_READ = 0, 267
GRIP = 1
BUSY, DETECTED, SAFETY = 0b1, 0b10, 0b1111100
OPEN_SLACK_M = 0.002
M_PER_UNIT = 1e-4


class Rg2:
    """A :class:`~.gripper.Gripper` of OnRobot's. Its raw readings are tenths of a millimetre: a small one is closed."""

    def __init__(self, config: GripperConfig) -> None:
        """Nothing is connected yet."""
        self.config = config
        self.closed_count = config.closed_count
        self._bus: Modbus | None = None

    @property
    def serial(self) -> str:
        """It tells none; the model."""
        return self.config.model

    def probe(self) -> dict[str, int]:
        """See :class:`~.gripper.Gripper`."""
        self._bus = Modbus(self.config.address, self.config.port or PORT, UNIT, timeout_s=ANSWER_S)
        width, status = self._opened.read(WIDTH_READ, 2)
        return {"WIDTH": width, "STATUS": status}

    def connect(self) -> None:
        """See :class:`~.gripper.Gripper`."""
        self.probe()
        try:
            self.read()
        except BaseException:
            self.disconnect()
            raise

    def open(self) -> GripResult:
        """See :class:`~.gripper.Gripper`."""
        result = self._move(self.config.stroke_m)
        if result.width_m < self.config.stroke_m - OPEN_SLACK_M:
            raise DeviceError(f"gripper: opened to {result.width_m:.4f} m only, expected {self.config.stroke_m}")
        return result

    def close(self) -> GripResult:
        """See :class:`~.gripper.Gripper`."""
        return self._move(0.0)

    def read(self) -> GripResult:
        """See :class:`~.gripper.Gripper`."""
        width, status = self._opened.read(WIDTH_READ, 2)
        if status & SAFETY:
            raise DeviceError(f"gripper: safety switch pressed (status {status:#x}); switch its power off and on")
        detected = bool(status & DETECTED)
        # closed_count is the reading with the pads together: what remains of it is no opening.
        width_m = max(width - self.closed_count, 0) * M_PER_UNIT
        if not detected and width - self.closed_count <= self.config.margin_counts:
            width_m = 0.0
        elif detected:
            width_m = max(width_m, 1.01 * self.config.closed_width_m)
        return GripResult(
            width_m=min(width_m, self.config.stroke_m), object_detected=detected, raw={"WIDTH": width, "STATUS": status}
        )

    def recover(self) -> None:
        """See :class:`~.gripper.Gripper`: a new connection is all that helps from here."""
        self.disconnect()
        self.connect()

    def measure_closed(self) -> int:
        """See :class:`~.gripper.Gripper`."""
        self.open()
        result = self.close()
        self.open()
        return result.raw["WIDTH"]

    def disconnect(self) -> None:
        """See :class:`~.gripper.Gripper`."""
        if self._bus is not None:
            self._bus.close()
            self._bus = None

    def _move(self, width_m: float) -> GripResult:
        bus, config = self._opened, self.config
        force = round(GREATEST_FORCE_DN * config.force)
        bus.write(FORCE, (force, round(width_m / M_PER_UNIT), GRIP))
        until = time.monotonic() + config.timeout_s
        time.sleep(POLL_S)  # The busy bit comes up a moment after the command.
        while bus.read(WIDTH_READ + 1)[0] & BUSY:
            if time.monotonic() > until:
                raise DeviceError(f"gripper: still busy after {config.timeout_s:g} s")
            time.sleep(POLL_S)
        return self.read()

    @property
    def _opened(self) -> Modbus:
        if self._bus is None:
            raise DeviceLostError("gripper: not connected")
        return self._bus
