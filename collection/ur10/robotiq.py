"""Robotiq 2F-85 and 2F-140 behind the URCap's socket, port 63352 of the robot.

Lines of text: ``SET POS 255 GTO 1`` is answered by ``ack`` in three bytes, mostly without a newline, ``GET POS`` by
``POS 228``. While the robot is in emergency stop an answer is ``?``. Positions are counts, 0 open; the pads meet near
228, not at 255, and wear moves that. The position alone misses thin sheets and OBJ alone is good to some millimetres,
so an object is told by either.
"""

from __future__ import annotations

import contextlib
import socket
import time

from handsight.collection.errors import DeviceError, DeviceLostError
from handsight.collection.ur10.gripper import GripResult
from handsight.collection.ur10.rig import GripperConfig

PORT = 63352
ANSWER_S = 2.0
POLL_S = 0.01
ACTIVATED = 3
MOVING, STOPPED_CLOSING = 0, 2
OPEN_SLACK_COUNTS = 4
READ = ("POS", "PRE", "OBJ", "STA", "FLT")
HARMLESS_FAULTS = (0, 5)
"""None, and an action that waits for a completed activation."""
FAULTS = {
    7: "not activated", 8: "too hot", 9: "no communication for a second", 10: "supply voltage too low",
    11: "automatic release under way", 12: "internal fault", 13: "activation failed", 14: "overcurrent",
    15: "automatic release completed",
}  # fmt: skip


class Robotiq:
    """A :class:`~.gripper.Gripper` of Robotiq's."""

    def __init__(self, config: GripperConfig) -> None:
        """Nothing is connected yet."""
        self.config = config
        self.closed_count = config.closed_count
        """Reading with the jaws closed on nothing; measured anew as the pads wear."""
        self._socket: socket.socket | None = None
        self._rest = b""
        self._serial = ""
        self._doubtful = False
        """Whether it failed to end a move: then only an activation is sure to help."""

    @property
    def serial(self) -> str:
        """Its bus id: the URCap tells nothing else."""
        return self._serial

    def probe(self) -> dict[str, int]:
        """See :class:`~.gripper.Gripper`."""
        self._open_socket()
        return {name: self._get(name) for name in READ}

    def connect(self) -> None:
        """Connect, and activate it where that is to be done; see :class:`~.gripper.Gripper`."""
        self._open_socket()
        try:
            self._serial = f"{self.config.model}/{self._get('SID')}"
            if self._get("STA") != ACTIVATED or self._get("FLT") not in HARMLESS_FAULTS:
                self._activate()
        except BaseException:
            self.disconnect()
            raise

    def open(self) -> GripResult:
        """See :class:`~.gripper.Gripper`."""
        result = self._move(self.config.open_count)
        if result.raw["POS"] > self.config.open_count + OPEN_SLACK_COUNTS:
            raise DeviceError(
                f"gripper: opened to {result.raw['POS']} counts only, expected {self.config.open_count}: "
                "something keeps the jaws from opening"
            )
        return result

    def close(self) -> GripResult:
        """See :class:`~.gripper.Gripper`."""
        return self._move(255)

    def read(self) -> GripResult:
        """See :class:`~.gripper.Gripper`."""
        raw = {name: self._get(name) for name in READ}
        self._refuse_fault(raw)
        return self._result(raw)

    def recover(self) -> None:
        """See :class:`~.gripper.Gripper`: connect anew and, unless that was all, reset and activate."""
        self.disconnect()
        self._open_socket()
        if self._get("FLT") == 8:
            raise DeviceError("gripper: too hot; let it cool before it is activated again")
        if self._doubtful or self._get("STA") != ACTIVATED or self._get("FLT") not in HARMLESS_FAULTS:
            self._activate()

    def measure_closed(self) -> int:
        """See :class:`~.gripper.Gripper`."""
        self.open()
        result = self.close()
        self.open()
        return result.raw["POS"]

    def disconnect(self) -> None:
        """See :class:`~.gripper.Gripper`."""
        if self._socket is not None:
            with contextlib.suppress(OSError):
                self._socket.close()
        self._socket, self._rest = None, b""

    def _result(self, raw: dict[str, int]) -> GripResult:
        config = self.config
        detected = raw["OBJ"] == STOPPED_CLOSING
        span = self.closed_count - config.open_count
        width_m = config.stroke_m * (self.closed_count - raw["POS"]) / span
        if raw["POS"] >= self.closed_count - config.margin_counts:
            # Closed on nothing as far as the position tells; what only OBJ feels is as thin as can be told.
            width_m = 1.01 * config.closed_width_m if detected else 0.0
        elif raw["OBJ"] != MOVING and width_m <= config.closed_width_m:
            width_m = 1.01 * config.closed_width_m
        return GripResult(width_m=min(max(width_m, 0.0), config.stroke_m), object_detected=detected, raw=raw)

    def _move(self, count: int) -> GripResult:
        config = self.config
        speed, force = round(255 * config.speed), round(255 * config.force)
        self._set(f"SET POS {count} SPE {speed} FOR {force} GTO 1")
        until = time.monotonic() + config.timeout_s
        self._doubtful = True
        while self._get("PRE") != count:
            self._wait(until, f"the echo of position {count}")
        while self._get("OBJ") == MOVING:
            self._refuse_fault({"FLT": self._get("FLT"), "STA": self._get("STA")})
            self._wait(until, f"the jaws to stand, sent to {count}")
        self._doubtful = False
        return self.read()

    def _activate(self) -> None:
        until = time.monotonic() + 2 * self.config.timeout_s
        self._set("SET ACT 0 ATR 0")
        while (self._get("ACT"), self._get("STA")) != (0, 0):
            self._wait(until, "the reset")
        self._set("SET ACT 1")
        while self._get("STA") != ACTIVATED:
            self._wait(until, "the activation")
        self._refuse_fault({"FLT": self._get("FLT"), "STA": ACTIVATED})

    def _wait(self, until: float, what: str) -> None:
        if time.monotonic() > until:
            raise DeviceError(f"gripper: waited too long for {what}")
        time.sleep(POLL_S)

    @staticmethod
    def _refuse_fault(raw: dict[str, int]) -> None:
        if raw["FLT"] not in HARMLESS_FAULTS:
            raise DeviceError(f"gripper: fault {raw['FLT']}: {FAULTS.get(raw['FLT'], 'see its manual')}")
        if raw["STA"] != ACTIVATED:
            raise DeviceError(f"gripper: not activated (STA {raw['STA']}): it was reset or lost its power")

    def _open_socket(self) -> None:
        address, port = self.config.address, self.config.port or PORT
        try:
            self._socket = socket.create_connection((address, port), timeout=ANSWER_S)
        except OSError as error:
            raise DeviceLostError(f"gripper {address}:{port}: {error}") from error

    def _set(self, line: str) -> None:
        answer = self._ask(line)
        if answer != "ack":
            raise DeviceError(f"gripper: {line!r} was answered with {answer!r}, expected 'ack'")

    def _get(self, name: str) -> int:
        answer = self._ask(f"GET {name}")
        head, _, value = answer.partition(" ")
        if head != name or not value.isdigit():
            raise DeviceError(f"gripper: {name} was answered with {answer!r}; '?' means an emergency stop")
        return int(value)

    def _ask(self, line: str) -> str:
        if self._socket is None:
            raise DeviceLostError("gripper: not connected")
        try:
            self._socket.sendall(f"{line}\n".encode())
            return self._answer()
        except OSError as error:
            self.disconnect()
            raise DeviceLostError(f"gripper: {line}: {str(error) or type(error).__name__}") from error

    def _answer(self) -> str:
        """One answer: a line, or the three bytes of an acknowledgement, or a question mark."""
        assert self._socket is not None
        while True:
            self._rest = self._rest.lstrip(b"\r\n")
            if b"\n" in self._rest:
                line, _, self._rest = self._rest.partition(b"\n")
                return line.decode("ascii", errors="replace").strip()
            if self._rest[:3] == b"ack":
                self._rest = self._rest[3:]
                return "ack"
            if self._rest[:1] == b"?":
                self._rest = self._rest[1:]
                return "?"
            got = self._socket.recv(256)
            if not got:
                raise ConnectionError("the connection was closed")
            self._rest += got
