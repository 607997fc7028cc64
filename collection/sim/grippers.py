"""The grippers there are, by name: the figures of a parallel gripper that the physics and the clear space follow from.

Robotiq's two-finger grippers give the strokes. Both have the same fingers and the same length here, so that stroke is
all that differs between them: it is what sets how many random grasps hold (decision 009).
"""

from __future__ import annotations

from dataclasses import dataclass

from handsight.collection.errors import StationSettingsError

FLANGE_TO_TIP_M = 0.16
"""Distance from the UR10's flange to the fingertips, of every gripper."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Gripper:
    """A parallel gripper of boxes: a palm and two fingers. Sizes are along the tool's x (jaws), y and z (down)."""

    name: str
    stroke_m: float
    """Opening of the fully open jaws."""
    finger_m: tuple[float, float, float] = (0.010, 0.022, 0.065)
    palm_y_m: float = 0.07
    palm_z_m: float = 0.09
    palm_margin_m: float = 0.0025
    """What the palm stands out beyond each open finger, as the knuckles of the real linkages do."""

    @property
    def palm_m(self) -> tuple[float, float, float]:
        """The palm, as wide as the open fingers are apart outside."""
        return self.stroke_m + 2 * (self.finger_m[0] + self.palm_margin_m), self.palm_y_m, self.palm_z_m


GRIPPERS = {
    gripper.name: gripper for gripper in (Gripper(name="2f-85", stroke_m=0.085), Gripper(name="2f-140", stroke_m=0.14))
}
DEFAULT_GRIPPER = "2f-85"


def gripper_named(name: str) -> Gripper:
    """The gripper of that name.

    Raises:
        StationSettingsError: There is none.
    """
    if name not in GRIPPERS:
        raise StationSettingsError(f"gripper is {name!r}, expected one of: {', '.join(GRIPPERS)}")
    return GRIPPERS[name]
