"""What the station asks of a gripper, whoever made it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from handsight.collection.ur10.rig import GripperConfig


@dataclass(frozen=True, slots=True, kw_only=True)
class GripResult:
    """One reading of the jaws."""

    width_m: float
    """Opening between the pads; 0 where the reading cannot be told from closed on nothing."""
    object_detected: bool
    raw: dict[str, int]
    """The registers it was read from, as the device calls them."""


class Gripper(Protocol):
    """A parallel gripper."""

    closed_count: int
    """Raw reading with the jaws closed on nothing; set it to what was measured."""

    @property
    def serial(self) -> str:
        """What tells it from another of its model, as far as it says."""

    def probe(self) -> dict[str, int]:
        """Connect and read the registers, faults or not; nothing moves.

        Raises:
            DeviceError: It does not answer, or not as a gripper.
        """

    def connect(self) -> None:
        """Connect and get ready; fingers may move.

        Raises:
            DeviceError: It does not answer, or reports a fault.
        """

    def open(self) -> GripResult:
        """Open the jaws fully and wait until they stand.

        Raises:
            DeviceError: They do not, or something keeps them from it.
        """

    def close(self) -> GripResult:
        """Close until the jaws meet or hold something, and wait until they stand.

        Raises:
            DeviceError: They do not stand in time.
        """

    def read(self) -> GripResult:
        """Read without moving.

        Raises:
            DeviceError: No answer, or a fault.
        """

    def recover(self) -> None:
        """Get it going again after a fault; fingers may move.

        Raises:
            DeviceError: It does not come back.
        """

    def measure_closed(self) -> int:
        """The raw reading with the jaws closed on nothing; opens, closes and opens them.

        Raises:
            DeviceError: As for :meth:`close`.
        """

    def disconnect(self) -> None:
        """End the connection; the jaws stay as they are."""


def gripper_for(config: GripperConfig) -> Gripper:
    """The driver of a rig's gripper, not yet connected."""
    if config.kind == "rg2":
        from handsight.collection.ur10.onrobot import Rg2

        return Rg2(config)
    from handsight.collection.ur10.robotiq import Robotiq

    return Robotiq(config)
