"""Settings of the simulated station, with the paper's section V-B as the default."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from handsight.collection.errors import StationSettingsError
from handsight.collection.sim.grippers import DEFAULT_GRIPPER, GRIPPERS
from handsight.collection.sim.renderer import RENDERERS, TINY
from handsight.collection.station import Workspace
from handsight.datasets.errors import counted
from handsight.servoing.camera import HandCamera, Intrinsics

D435_COLOUR_FOV_Y_RAD = math.radians(42.5)
"""Vertical field of view of the D435's colour sensor (datasheet: 69 x 42 degrees); the 640x480 mode crops its sides."""

D435_ON_GRIPPER = HandCamera(
    intrinsics=Intrinsics.from_vertical_fov(width=640, height=480, fov_y_rad=D435_COLOUR_FOV_Y_RAD),
    x_tool_camera_m=0.0,
    y_tool_camera_m=-0.055,
    z_tool_camera_m=-0.10,
)
"""A D435 clamped to the wrist in front of the gripper. The fingers stay out of the picture."""


RANDOMIZED = ("table", "light", "colour", "friction", "depth-noise")
"""What can differ between scenes beside the objects; ``randomization.py`` draws the values."""

DROP_SPACING_M = 0.12
"""Objects are dropped at least this far apart, centre to centre."""
DROP_LAYERS = 4
TOUCH_MARGIN_M = 0.008
"""The descent is slow from so far above the first touch on."""


PHYSICS_VERSION = 3
"""Recorded with every session, and raised whenever equal settings and seeds stop giving equal attempts: those recorded
under another version cannot be simulated again. Sessions that say nothing have version 1."""

MOST_REDRAWS = 10
"""Scenes that may fail to settle before an attempt is given up."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SimConfig:
    """Everything that, with a seed, determines a simulated attempt."""

    objects: str = "household-train"
    """Object set; see ``handsight objects ls``."""
    objects_per_scene: int = 5
    drop_height_m: float = 0.15
    overhead_height_m: float = 0.5
    pregrasp_height_m: float = 0.4
    lift_height_m: float = 0.25
    table_height_m: float = 0.005
    """Where the fingertips stop when nothing touched them: just above the table, as a rig must."""
    contact_force_n: float = 10.0
    """Force of everything that touches arm and hand that counts as contact and ends the descent."""
    touch_speed_m_s: float = 0.1
    """Speed of the descent from ``TOUCH_MARGIN_M`` before the first touch on."""
    yield_force_n: float = 15.0
    """What the slide of the hand resists with during the descent, beside its weight of 9 N."""
    shakes: int = 0
    """Shakes after the lift. Section III-B has three, the simulated experiments of V-B none."""
    workspace: Workspace = field(
        default_factory=lambda: Workspace(x_min_m=0.5, x_max_m=0.8, y_min_m=-0.15, y_max_m=0.15)
    )
    camera: HandCamera = D435_ON_GRIPPER
    depth_scale_m: float = 0.001
    gripper: str = DEFAULT_GRIPPER
    """One of ``grippers.GRIPPERS``; sets the stroke."""
    closed_width_m: float = 0.001
    """Openings up to this count as fully closed: object thickness that the jaws cannot resolve."""
    grip_force_n: float = 40.0
    finger_friction: float = 1.8
    """Lateral friction of the fingertips. Bullet multiplies it with that of the object, 0.7 to 0.8 for most, which
    gives the 1.3 between fingers and objects of the paper (section V-B)."""
    sticky_contacts: bool = True
    """Fingertips hold a touched point by a spring until friction gives way (Bullet's friction anchors), where plain
    friction creeps under load. The paper's "sticky contacts" (section V-B)."""
    physics_hz: int = 240
    solver_iterations: int = 50
    solver_residual: float = 1e-4
    """The solver ends a step's iterations early once they change less than this (squared velocities)."""
    grip_iterations: int = 100
    """Most iterations of a step from the closing of the jaws on: fewer let fingers sink into what they squeeze."""
    settle_limit_s: float = 5.0
    vary: tuple[str, ...] = ()
    """What differs between scenes beside the objects; some of ``RANDOMIZED``."""
    renderer: str = TINY.name
    """Who draws the objects: ``tiny``, the same bytes on every machine, or ``egl``, faster with a good driver."""

    def __post_init__(self) -> None:
        faults = []
        if self.objects_per_scene < 1:
            faults.append(f"objects_per_scene is {self.objects_per_scene}, expected at least 1")
        if self.shakes < 0:
            faults.append(f"shakes is {self.shakes}, expected 0 or more")
        if not 0 <= self.table_height_m < self.lift_height_m < self.pregrasp_height_m <= self.overhead_height_m:
            faults.append(
                f"heights are table {self.table_height_m}, lift {self.lift_height_m}, pre-grasp "
                f"{self.pregrasp_height_m}, overhead {self.overhead_height_m} m, expected ascending"
            )
        if self.gripper not in GRIPPERS:
            faults.append(f"gripper is {self.gripper!r}, expected one of: {', '.join(GRIPPERS)}")
        elif not 0 < self.closed_width_m < self.gripper_stroke_m:
            faults.append(f"closed_width_m is {self.closed_width_m}, expected between 0 and {self.gripper_stroke_m}")
        if not 0 <= self.solver_residual < 1:
            faults.append(f"solver_residual is {self.solver_residual}, expected 0 to 1")
        if self.touch_speed_m_s <= 0 or self.yield_force_n < 0:
            faults.append(
                f"the hand touches at {self.touch_speed_m_s} m/s and yields at {self.yield_force_n} N, expected more "
                "than 0 m/s and 0 N or more"
            )
        if self.physics_hz < 60 or min(self.solver_iterations, self.grip_iterations) < 1:
            faults.append(
                f"physics runs at {self.physics_hz} Hz with {counted(self.solver_iterations, 'iteration')}, "
                f"{self.grip_iterations} while gripping, expected at least 60 Hz and 1 iteration"
            )
        unknown = [kind for kind in self.vary if kind not in RANDOMIZED]
        if unknown or len(set(self.vary)) < len(self.vary):
            faults.append(f"vary is {', '.join(self.vary)}, expected some of {', '.join(RANDOMIZED)}, each once")
        room = self.most_objects
        if self.objects_per_scene > room:
            faults.append(f"objects_per_scene is {self.objects_per_scene}, expected at most {room}: no more fit")
        faults += self._renderer_faults()
        if faults:
            raise StationSettingsError("; ".join(faults))

    @property
    def gripper_stroke_m(self) -> float:
        """Opening of the gripper's fully open jaws [m]."""
        return GRIPPERS[self.gripper].stroke_m

    def to_json(self) -> dict[str, Any]:
        """The settings as JSON values, as every session records them."""
        return {
            **asdict(self),
            "camera": self.camera.to_json(),
            "vary": list(self.vary),
            "gripper_stroke_m": self.gripper_stroke_m,
            "physics": PHYSICS_VERSION,
        }

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> SimConfig:
        """The settings that a session recorded; those that were not there yet have their defaults.

        The version of the physics is not among them: see :func:`recorded_physics`.

        Raises:
            KeyError, TypeError: What every session records is missing, or there is a value too many.
            CameraModelError, StationSettingsError: The values make no camera or no station.
        """
        parts = {
            "camera": HandCamera.from_json(values["camera"]),
            "workspace": Workspace(**values["workspace"]),
            "vary": tuple(values.get("vary", ())),
        }
        settings = {name: value for name, value in values.items() if name not in ("gripper_stroke_m", "physics")}
        config = cls(**{**settings, **parts})
        stroke_m = values.get("gripper_stroke_m", config.gripper_stroke_m)
        if stroke_m != config.gripper_stroke_m:
            raise StationSettingsError(
                f"gripper_stroke_m is {stroke_m}, expected the {config.gripper_stroke_m} of the gripper "
                f"{config.gripper}: name one of {', '.join(GRIPPERS)}"
            )
        return config

    def _renderer_faults(self) -> list[str]:
        if self.renderer not in RENDERERS:
            return [f"renderer is {self.renderer!r}, expected one of: {', '.join(RENDERERS)}"]
        renderer = RENDERERS[self.renderer]
        k = self.camera.intrinsics
        faults = []
        if renderer.largest_px is not None and (k.width > renderer.largest_px[0] or k.height > renderer.largest_px[1]):
            width, height = renderer.largest_px
            faults.append(
                f"the camera has {k.width}x{k.height} pixels, the renderer {self.renderer!r} draws at most "
                f"{width}x{height}: use the renderer {TINY.name!r}"
            )
        if "light" in self.vary and not renderer.coloured_light:
            faults.append(
                f"vary has 'light', of which the renderer {self.renderer!r} knows the direction alone: "
                f"use the renderer {TINY.name!r}"
            )
        return faults

    @property
    def most_objects(self) -> int:
        """How many objects can be dropped at a time: side by side over the workspace, in so many layers."""
        area = self.workspace
        columns = int((area.x_max_m - area.x_min_m) / DROP_SPACING_M) + 1
        rows = int((area.y_max_m - area.y_min_m) / DROP_SPACING_M) + 1
        return columns * rows * DROP_LAYERS


def recorded_physics(values: Mapping[str, Any]) -> int:
    """The version of the physics under which a session with these recorded settings was collected."""
    return int(values.get("physics", 1))
