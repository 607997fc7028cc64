"""What one grasp attempt is, whoever performed it.

A station (simulated or real) produces :class:`GraspAttempt`; the writer stores it as recorded and derives nothing.
Frames: B is the robot's base with the table top at z = 0; T is the tool frame between the fingertips (x along the
closing direction of the jaws, z along the approach); C is the camera frame (x right, y down, z forward).
``pose_b_a`` maps coordinates in A to coordinates in B.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handsight.servoing.camera import HandCamera


class Outcome(IntEnum):
    """How an attempt ended. Only EMPTY and HELD carry a label."""

    EMPTY = 0
    """The gripper closed fully: nothing between the fingers."""
    HELD = 1
    """The gripper was not fully closed after lift (and shakes): the paper's success."""
    UNREACHABLE = 2
    """The pre-grasp or grasp pose is outside the arm's reach; nothing was executed from there on."""
    ABORTED = 3
    """A phase failed or was stopped; ``GraspAttempt.failure`` says which and why."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RgbdFrame:
    """One RGB-D picture, aligned pixel to pixel, and where it was taken."""

    rgb: NDArray[np.uint8]
    """Shape (H, W, 3)."""
    depth: NDArray[np.uint16]
    """Distance along the optical axis in units of the camera's ``depth_scale_m``; 0 is invalid. Shape (H, W)."""
    pose_base_tool: NDArray[np.float64]
    """Tool frame in the base frame when the picture was taken. Shape (4, 4)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StationSpec:
    """What stays fixed during a session: the instruments, as needed to interpret every attempt."""

    source: str
    """``sim`` or ``ur10``."""
    camera: HandCamera
    depth_scale_m: float
    """Metres per unit of raw depth."""
    gripper_stroke_m: float
    """Opening of the fully open gripper [m]."""
    closed_width_m: float
    """Readings at or below this opening count as fully closed [m]."""
    pregrasp_height_m: float = 0.4
    """Height of the fingertips above the table when the grasp policy starts (0.4 in simulation, 0.2 on the rig) [m]."""
    objects: tuple[str, ...] = ()
    """Catalogue of object ids; attempts index into it."""
    conditions: tuple[str, ...] = ()
    """Names of what is varied from attempt to attempt, such as ``table_friction``; scenes hold the values."""
    serials: dict[str, str] | None = None
    """Serial numbers of robot, camera and gripper, where there are any."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneObjects:
    """The objects of one attempt after they came to rest (simulation only)."""

    catalogue_index: NDArray[np.int16]
    """Index of each object in ``StationSpec.objects``. Shape (M,)."""
    pose_base_object: NDArray[np.float64]
    """Position [m] and quaternion, as x y z qx qy qz qw, when the overhead picture was taken. Shape (M, 7)."""
    target: int
    """Which of the M objects the pre-grasp pose was drawn around."""
    conditions: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    """Values of ``StationSpec.conditions`` in this attempt. Shape (K,)."""


PHASES = ("settle", "look", "reach", "descend", "close", "lift", "shake")
"""Phases of the fixed grasp policy in the order in which they run (paper, sections III-B and V-B)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GripperReadings:
    """Jaw opening [m] at the moments that matter; NaN where the attempt never got there."""

    before_m: float
    closed_m: float
    lifted_m: float
    final_m: float
    """After the shakes; equals ``lifted_m`` when there were none. The label is read off this one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GraspAttempt:
    """One attempt, complete: pictures, poses, readings, outcome, provenance."""

    number: int
    """Position in the session, from 0. With the session's seed it determines a simulated attempt entirely."""
    outcome: Outcome
    failure: str
    """Empty, or ``phase: reason`` for UNREACHABLE and ABORTED."""
    overhead: RgbdFrame | None
    """The view from the pre-set pose, 0.5 m above the table; None when the attempt ended before it."""
    pregrasp: RgbdFrame | None
    """The view from the pre-grasp pose; None when it was not asked for or never reached."""
    pregrasp_x_m: float
    pregrasp_y_m: float
    pregrasp_angle_rad: float
    """The pre-grasp pose commanded, in the base frame."""
    predicted_success: float = float("nan")
    """What the network that chose the pose expected of it; NaN where none did."""
    pose_base_tool_grasp: NDArray[np.float64]
    """Measured tool pose when the jaws closed; NaN when they did not. Shape (4, 4)."""
    contact_force_n: float
    """Force of contact that ended the descent [N]; 0 when it ended at table height."""
    gripper: GripperReadings
    scene: SceneObjects | None
    truth_held: bool | None
    """Simulator truth: an object is held above the table at the end. None where there is no truth."""
    phase_s: NDArray[np.float32]
    """Duration of each of ``PHASES`` in the station's own time [s]. Shape (7,)."""
    started_ns: int
    """Wall clock at the start, nanoseconds since the epoch. Left out of the digest."""
    elapsed_ns: int
    """Wall time taken [ns]. Left out of the digest."""

    @property
    def labelled(self) -> bool:
        """Whether the attempt ran to its end and so carries a label."""
        return self.outcome in (Outcome.EMPTY, Outcome.HELD)

    @property
    def success(self) -> bool:
        """Whether the attempt carries a label, and it is that the object was held. False without a label."""
        return self.outcome == Outcome.HELD


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionHeader:
    """Provenance shared by the attempts of one session; written once, when the session opens."""

    station: StationSpec
    seed: int | None
    """Seed of a simulated session; None on a real rig."""
    objects_per_scene: int
    """Largest number of objects in a scene; the width of the per-object columns."""
    config: dict[str, Any]
    """The resolved configuration of station and collector, as JSON values."""
