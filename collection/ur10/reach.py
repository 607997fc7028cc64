"""Which part of the workspace the arm reaches, and the controller's safety planes allow; nothing moves to find out."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np

from handsight.collection.errors import PoseRefusedError, RigSettingsError
from handsight.collection.station import Workspace
from handsight.collection.ur10.arm import Arm
from handsight.collection.ur10.calibration import ReachCalibration, today
from handsight.collection.ur10.rig import WorkspaceConfig
from handsight.servoing.planar import PlanarPose

STEP_M = 0.02
LEAST_SHARE = 0.2
"""With less than that the workspace is somewhere else than was meant."""
_ROUNDING_M = 1e-6


def calibrate_reach(arm: Arm, *, on_cell: Callable[[], None] | None = None) -> ReachCalibration:
    """Ask for every cell of the workspace, at the pre-grasp height and at the table.

    Args:
        arm: Under control.
        on_cell: Called after each.

    Raises:
        RigSettingsError: Hardly any of it is reached.
        DeviceError: The controller does not answer.
    """
    area = arm.rig.workspace
    rows = []
    for x_m in _middles(area.x_min_m, area.x_max_m):
        row = ""
        for y_m in _middles(area.y_min_m, area.y_max_m):
            row += "#" if _allowed(arm, x_m, y_m) else "."
            if on_cell is not None:
                on_cell()
        rows.append(row)
    found = ReachCalibration(date=today(), x_min_m=area.x_min_m, y_min_m=area.y_min_m, step_m=STEP_M, rows=tuple(rows))
    if found.share < LEAST_SHARE:
        raise RigSettingsError(
            f"{found.share:.0%} of the workspace is reached, expected at least {LEAST_SHARE:.0%}: look at [workspace] "
            "of rig.toml, and at the safety planes of the controller"
        )
    return found


def cells(area: WorkspaceConfig) -> int:
    """How many are asked for."""
    return len(_middles(area.x_min_m, area.x_max_m)) * len(_middles(area.y_min_m, area.y_max_m))


def _middles(low_m: float, high_m: float) -> list[float]:
    """Middles of the cells that cover an interval; the last one may reach beyond it, and has its middle inside."""
    count = max(1, math.ceil((high_m - low_m) / STEP_M - 1e-9))
    return [min(low_m + (number + 0.5) * STEP_M, high_m) for number in range(count)]


def _allowed(arm: Arm, x_m: float, y_m: float) -> bool:
    area = arm.rig.workspace
    pose = PlanarPose(x_m=x_m, y_m=y_m, angle_rad=0.0)
    try:
        return all(
            arm.allowed_by_controller(pose.pose_base_tool(height_m))
            for height_m in (area.pregrasp_height_m, area.clearance_m)
        )
    except PoseRefusedError:
        return False


def check_reach(reach: ReachCalibration, area: WorkspaceConfig) -> None:
    """Refuse a map that does not cover the workspace.

    Raises:
        RigSettingsError: It was measured of another one.
    """
    x_max_m = reach.x_min_m + reach.step_m * len(reach.rows)
    y_max_m = reach.y_min_m + reach.step_m * len(reach.rows[0])
    outside = area.x_min_m < reach.x_min_m or area.y_min_m < reach.y_min_m
    if outside or area.x_max_m > x_max_m + _ROUNDING_M or area.y_max_m > y_max_m + _ROUNDING_M:
        raise RigSettingsError(
            f"the reach was measured for x {reach.x_min_m:g} to {x_max_m:g} and y {reach.y_min_m:g} to {y_max_m:g} m, "
            "and [workspace] of rig.toml is larger: run 'rig calibrate reach'"
        )
    middles = product(_middles(area.x_min_m, area.x_max_m), _middles(area.y_min_m, area.y_max_m))
    reached = [_reached(reach, x_m, y_m) for x_m, y_m in middles]
    if sum(reached) < LEAST_SHARE * len(reached):
        raise RigSettingsError(
            f"of [workspace] in rig.toml {sum(reached) / len(reached):.0%} is reached, expected at least "
            f"{LEAST_SHARE:.0%}: lay it elsewhere, or run 'rig calibrate reach'"
        )


def reached_workspace(area: WorkspaceConfig, reach: ReachCalibration | None) -> Workspace:
    """Where grasps are drawn: the whole area where its reach was not measured."""
    if reach is None:
        return area.area
    return ReachedWorkspace(
        x_min_m=area.x_min_m, x_max_m=area.x_max_m, y_min_m=area.y_min_m, y_max_m=area.y_max_m, reach=reach
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class ReachedWorkspace(Workspace):
    """A workspace of which only a part is reached: points are drawn uniformly from that part."""

    reach: ReachCalibration

    def sample(self, rng: np.random.Generator) -> tuple[float, float]:
        """A uniformly drawn point (x, y) of the part that is reached [m]."""
        while True:
            # Of a part of at least LEAST_SHARE, five draws find one on average.
            x_m = float(rng.uniform(self.x_min_m, self.x_max_m))
            y_m = float(rng.uniform(self.y_min_m, self.y_max_m))
            if _reached(self.reach, x_m, y_m):
                return x_m, y_m


def _reached(reach: ReachCalibration, x_m: float, y_m: float) -> bool:
    """Whether a point lies in a cell that is reached."""
    row = math.floor((x_m - reach.x_min_m) / reach.step_m)
    column = math.floor((y_m - reach.y_min_m) / reach.step_m)
    inside = 0 <= row < len(reach.rows) and 0 <= column < len(reach.rows[0])
    return inside and reach.rows[row][column] == "#"
