"""What a rig is: every address, figure and limit of it, as ``rig.toml`` has them.

The file has a table for each device and each concern; a key has its unit in its name, in metres, kilograms, newtons,
seconds and degrees. Nothing is looked up on the network here: a file is sound or all of its faults are told at once.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from handsight.collection.station import Workspace

GENERATIONS = ("cb3", "e-series")
CAMERAS = ("d435", "emulated", "recording")
GRIPPERS = ("robotiq", "rg2")


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotConfig:
    """The controller and what its arm carries."""

    address: str
    generation: str
    payload_kg: float
    """Gripper, camera and cables."""
    centre_of_mass_m: tuple[float, float, float]
    """Of the payload, in the flange frame."""
    tcp_length_m: float
    """From the flange to the fingertips."""
    dashboard_port: int = 29999
    primary_port: int = 30001
    upper_registers: bool = False
    """Use the registers 24 to 47, where a fieldbus owns the lower ones."""
    stale_s: float = 0.5
    """Data of this age mean that the connection is gone."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraConfig:
    """The camera on the gripper."""

    kind: str
    serial: str = ""
    """As printed on it; empty takes the only one there is, and refuses two."""
    address: str = ""
    """Of an emulated camera."""
    port: int = 8435
    file: str = ""
    """A ``.db3`` recording, relative to rig.toml."""
    width: int = 640
    height: int = 480
    fps: int = 30
    exposure_us: int = 0
    """Fixed exposure of the colour camera; 0 leaves it to the camera."""
    nearest_m: float = 0.10
    """Nearer depth is noise."""
    farthest_m: float = 1.0
    """Farther depth is noise."""
    least_valid: float = 0.3
    """Share of the depth picture that must be valid before holes are filled."""
    timeout_s: float = 5.0
    mount_m: tuple[float, float, float] = (0.0, -0.055, -0.10)
    """About where the camera sits in the tool frame: views of the calibration board are planned by it."""
    power_cycle: tuple[str, ...] = ()
    """Command that switches the camera's USB port off and on, as words; empty where there is none."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GripperConfig:
    """The gripper and its jaws."""

    kind: str
    address: str
    model: str
    stroke_m: float
    """Opening of the open jaws."""
    closed_width_m: float
    """Openings up to this count as fully closed."""
    port: int = 0
    """0 takes the port of its kind: 63352 or 502."""
    open_count: int = 3
    closed_count: int = 228
    """Raw readings with the jaws open, and closed on nothing; ``rig calibrate gripper`` measures them."""
    margin_counts: int = 3
    """Readings so near to the closed one count as closed."""
    force: float = 0.2
    """Share of the greatest grip force."""
    speed: float = 1.0
    """Share of the greatest speed of the jaws."""
    pad_width_m: float = 0.022
    pad_length_m: float = 0.037
    timeout_s: float = 10.0
    remeasure_every: int = 200
    """Attempts between two measurements of the closed position; 0 never."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WorkspaceConfig:
    """Where the fingertips may be, in the robot's base frame."""

    x_min_m: float
    x_max_m: float
    y_min_m: float
    y_max_m: float
    yaw_min_deg: float = -95.0
    yaw_max_deg: float = 95.0
    table_height_m: float = 0.0
    """Of the table top in the robot's base frame; a table calibration takes its place."""
    clearance_m: float = 0.005
    """Above the table; where the fingertips stop if nothing touched them."""
    pregrasp_height_m: float = 0.2
    overhead_height_m: float = 0.5
    lift_height_m: float = 0.25
    drop_height_m: float = 0.1
    """Heights are above the table."""
    margin_m: float = 0.05
    """How far beside the area of the grasps the fingertips may be: for servoing and shaking."""

    @property
    def area(self) -> Workspace:
        """Where grasps are drawn."""
        return Workspace(x_min_m=self.x_min_m, x_max_m=self.x_max_m, y_min_m=self.y_min_m, y_max_m=self.y_max_m)

    @property
    def centre_m(self) -> tuple[float, float]:
        """Middle of the area (x, y)."""
        return 0.5 * (self.x_min_m + self.x_max_m), 0.5 * (self.y_min_m + self.y_max_m)


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionConfig:
    """How fast the arm moves, and when it has met something."""

    speed_m_s: float = 0.4
    acceleration_m_s2: float = 1.0
    descend_speed_m_s: float = 0.05
    lift_speed_m_s: float = 0.15
    shake_speed_m_s: float = 0.3
    shake_m: float = 0.03
    shakes: int = 3
    contact_force_n: float = 40.0
    """Over the force at standstill before the descent."""
    contact_samples: int = 3
    """Readings in a row over the force that mean contact."""
    baseline_s: float = 0.2
    stop_acceleration_m_s2: float = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class GuardConfig:
    """When the rig pauses by itself."""

    joint_temperature_c: float = 60.0
    disk_free_gb: float = 5.0
    success_window: int = 100
    """Attempts over which the rate of success is watched; 0 does not."""
    least_success: float = 0.02
    most_aborted: float = 0.5
    """Share of aborted attempts of the window above which something is wrong with the rig."""
    objects_height_m: float = 0.012
    """A table on which nothing stands higher is empty."""
    empty_looks: int = 3
    """Overhead pictures of an empty table in a row that call for a refill; 0 does not look."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RecoveryConfig:
    """What the rig may do about a stop without a person."""

    protective_stops_per_10_min: int = 3
    recoveries_per_hour: int = 20
    restart_safety: bool = False
    """Whether a fault or violation of the safety system is restarted; a person should look first."""
    power_on: bool = True
    """Whether an arm without power is switched on and its brakes released."""
    unlock_wait_s: float = 5.5
    retreat_m: float = 0.10
    """How far the tool is lifted, slowly, after a stop."""
    retreat_speed_m_s: float = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class BoardConfig:
    """The ChArUco board of the camera calibration, flat on the table in the middle of the workspace."""

    columns: int = 7
    rows: int = 5
    square_m: float = 0.03
    marker_m: float = 0.022
    dictionary: str = "DICT_4X4_50"


@dataclass(frozen=True, slots=True, kw_only=True)
class AlarmConfig:
    """Who is told, outside this machine."""

    command: tuple[str, ...] = ()
    """Command as words; the text is its last argument."""
    webhook: str = ""
    """URL that gets a POST of ``{"text": ...}``."""
    timeout_s: float = 10.0


@dataclass(frozen=True, slots=True, kw_only=True)
class RigConfig:
    """One rig."""

    robot: RobotConfig
    camera: CameraConfig
    gripper: GripperConfig
    workspace: WorkspaceConfig
    motion: MotionConfig = field(default_factory=MotionConfig)
    guards: GuardConfig = field(default_factory=GuardConfig)
    recovery: RecoveryConfig = field(default_factory=RecoveryConfig)
    alarm: AlarmConfig = field(default_factory=AlarmConfig)
    board: BoardConfig = field(default_factory=BoardConfig)
    calibration: Path = Path("calibration.json")
    heartbeat: Path = Path("heartbeat.json")
    operator_log: Path = Path("operator_log.jsonl")
    readings: Path = Path("readings.jsonl")
    """Files, relative ones beside rig.toml."""

    def to_json(self) -> dict[str, Any]:
        """The rig as JSON values, without the files of this machine."""
        values = asdict(self)
        for name in ("calibration", "heartbeat", "operator_log", "readings", "alarm"):
            del values[name]
        return values
