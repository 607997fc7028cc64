"""What hands out librealsense's frame sets, and says which camera they are of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

from handsight.servoing.camera import Intrinsics


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraDescription:
    """What the camera says it is."""

    name: str
    serial: str
    firmware: str
    intrinsics: Intrinsics
    depth_scale_m: float


class Source(Protocol):
    """Hands out librealsense frame sets."""

    def wait(self, timeout_s: float) -> Any:
        """The next frame set with colour and depth.

        Raises:
            DeviceLostError: None came.
        """

    taken: tuple[int, float]
    """Number and time [ms] of the last frame set, by the camera's own count."""

    def description(self) -> CameraDescription:
        """What it is."""

    def reset(self) -> None:
        """Have the device restart."""

    def stop(self) -> None:
        """Stop it."""


def described(intrinsics: Any, scale_m: float, said: Callable[[str], str]) -> CameraDescription:
    """A description from librealsense's intrinsics and what ``said`` has under a name."""
    return CameraDescription(
        name=said("name"),
        serial=said("serial_number"),
        firmware=said("firmware_version"),
        intrinsics=Intrinsics(
            width=int(intrinsics.width),
            height=int(intrinsics.height),
            # Kept as floats of 32 bits there: 0.001 comes back as 0.0010000000475.
            fx=round(float(intrinsics.fx), 5),
            fy=round(float(intrinsics.fy), 5),
            cx=round(float(intrinsics.ppx), 5),
            cy=round(float(intrinsics.ppy), 5),
        ),
        depth_scale_m=round(scale_m, 9),
    )
