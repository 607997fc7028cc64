"""The closed loop on a drawn table: one bright disc that the gripper should end up over."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest
import torch
from torch import Tensor

from handsight.servoing.camera import HandCamera, Intrinsics
from handsight.servoing.errors import ImageError, ServoSettingsError
from handsight.servoing.heatmap import grasp_heatmap
from handsight.servoing.homography import InputGrid
from handsight.servoing.loop import ServoSettings, ServoTrace, servo
from handsight.servoing.methods.cem import Cem
from handsight.servoing.methods.first_order import FirstOrder
from handsight.servoing.objective import Objective, ScoreInputs
from handsight.servoing.optimiser import ServoMethod
from handsight.servoing.planar import PlanarPose
from handsight.servoing.view import View

CAMERA = HandCamera(
    intrinsics=Intrinsics(width=160, height=120, fx=150.0, fy=150.0, cx=79.5, cy=59.5),
    x_tool_camera_m=0.0,
    y_tool_camera_m=-0.03,
    z_tool_camera_m=-0.1,
)
GRID = InputGrid(crop_px=96, size_px=32)
DISTANCE_M = 0.5
DISC_XY_M = (0.60, 0.02)


@dataclass
class DrawnTable:
    """A world without physics: draws the disc as the camera would see it and remembers where the gripper went."""

    pose: PlanarPose
    reachable_m: float = 10.0
    visited: list[PlanarPose] = field(default_factory=list)

    def look(self) -> tuple[View, PlanarPose]:
        k = CAMERA.intrinsics
        columns, rows = np.meshgrid(np.arange(k.width), np.arange(k.height))
        x_m = (columns - k.cx) * DISTANCE_M / k.fx + CAMERA.x_tool_camera_m
        y_m = (rows - k.cy) * DISTANCE_M / k.fy + CAMERA.y_tool_camera_m
        disc = self.pose.step_to(PlanarPose(x_m=DISC_XY_M[0], y_m=DISC_XY_M[1], angle_rad=0.0))
        glow = np.exp(-((x_m - disc.dx_m) ** 2 + (y_m - disc.dy_m) ** 2) / (2 * 0.05**2))
        rgb = np.repeat((255 * glow).astype(np.uint8)[:, :, None], 3, axis=2)
        depth_m = np.full((k.height, k.width), DISTANCE_M, np.float32)
        return View(rgb=rgb, depth_m=depth_m, camera=CAMERA), self.pose

    def move(self, pose: PlanarPose) -> bool:
        if abs(pose.x_m - DISC_XY_M[0]) > self.reachable_m:
            return False
        self.pose = pose
        self.visited.append(pose)
        return True


def brightness_in_the_middle(inputs: Tensor) -> Tensor:
    return inputs[:, 0, 15:17, 15:17].mean((1, 2))


def run(
    world: DrawnTable, method: Cem | FirstOrder, score_inputs: ScoreInputs = brightness_in_the_middle
) -> ServoTrace:
    return servo(
        world.look,
        world.move,
        score_inputs,
        ServoMethod(name="test", label="test", settings=method),
        settings=ServoSettings(threshold=0.95, grid=GRID),
        rng=np.random.default_rng(0),
    )


START = PlanarPose(x_m=0.53, y_m=0.06, angle_rad=0.4)


@pytest.mark.parametrize("method", [Cem(), FirstOrder()], ids=["cem", "first-order"])
def test_the_loop_ends_over_the_disc(method: Cem | FirstOrder) -> None:
    world = DrawnTable(START)
    trace = run(world, method)
    assert trace.confident
    assert trace.grasp_score >= 0.95
    assert np.hypot(world.pose.x_m - DISC_XY_M[0], world.pose.y_m - DISC_XY_M[1]) < 0.02
    assert trace.grasp_pose == world.pose
    assert trace.moves == len(world.visited) == len(trace.steps) - 1
    assert trace.steps[-1].proposal is None


def test_a_good_start_is_grasped_at_once() -> None:
    world = DrawnTable(PlanarPose(x_m=DISC_XY_M[0], y_m=DISC_XY_M[1], angle_rad=0.0))
    trace = run(world, Cem())
    assert (trace.moves, world.visited) == (0, [])
    assert trace.confident


def test_out_of_steps_the_best_pose_seen_is_taken() -> None:
    """With half of the table dark the last views score nothing; the loop has to come back to where it was best."""
    world = DrawnTable(START)

    def dims(inputs: Tensor) -> Tensor:
        return brightness_in_the_middle(inputs) * (0.9 if len(world.visited) < 3 else 0.1)

    trace = run(world, Cem(max_steps=6), score_inputs=dims)
    scores = [step.score for step in trace.steps]
    best = int(np.argmax(scores))
    assert not trace.confident
    assert len(trace.steps) == 7
    assert best < 3
    assert trace.grasp_pose == trace.steps[best].pose == world.pose
    assert trace.grasp_score == scores[best]


def test_an_unreachable_step_ends_the_run_at_the_best_pose() -> None:
    world = DrawnTable(START, reachable_m=0.0)
    trace = run(world, Cem())
    assert trace.moves == 1
    assert world.visited == []
    assert trace.grasp_pose == START


def test_heatmap_peaks_where_the_gripper_should_go() -> None:
    world = DrawnTable(START)
    view, pose = world.look()
    heatmap = grasp_heatmap(view, brightness_in_the_middle, grid=GRID, spacing_px=4)
    row, column = np.unravel_index(heatmap.scores.argmax(), heatmap.scores.shape)
    k = CAMERA.intrinsics
    disc = pose.step_to(PlanarPose(x_m=DISC_XY_M[0], y_m=DISC_XY_M[1], angle_rad=0.0))
    expected_column = k.cx + (disc.dx_m - CAMERA.x_tool_camera_m) * k.fx / DISTANCE_M
    expected_row = k.cy + (disc.dy_m - CAMERA.y_tool_camera_m) * k.fy / DISTANCE_M
    assert abs(heatmap.columns_px[column] - expected_column) <= 4
    assert abs(heatmap.rows_px[row] - expected_row) <= 4


@pytest.mark.parametrize("threshold", [0.0, -1.0, 1.5])
def test_impossible_thresholds_are_refused(threshold: float) -> None:
    with pytest.raises(ServoSettingsError, match="expected in"):
        ServoSettings(threshold=threshold)


def test_a_spacing_of_nothing_is_refused() -> None:
    view, _ = DrawnTable(START).look()
    with pytest.raises(ServoSettingsError, match="at least 1"):
        grasp_heatmap(view, brightness_in_the_middle, grid=GRID, spacing_px=0)


def test_a_view_without_any_depth_is_refused() -> None:
    k = CAMERA.intrinsics
    rgb = np.zeros((k.height, k.width, 3), np.uint8)
    view = View(rgb=rgb, depth_m=np.zeros((k.height, k.width), np.float32), camera=CAMERA)
    with pytest.raises(ImageError, match="no pixel of the depth picture is valid"):
        _ = view.plane_m


def test_pictures_of_another_size_are_refused() -> None:
    with pytest.raises(ImageError) as caught:
        View(rgb=np.zeros((10, 10, 3), np.uint8), depth_m=np.ones((5, 5), np.float32), camera=CAMERA)
    assert "(10, 10, 3)" in str(caught.value)
    assert "(5, 5)" in str(caught.value)


def test_predictions_do_not_depend_on_the_batch() -> None:
    view, _ = DrawnTable(START).look()
    objective = Objective(view, brightness_in_the_middle, GRID)
    steps = torch.from_numpy(np.random.default_rng(0).normal(size=(9, 3)).astype(np.float32) * 0.05)
    alone = torch.stack([objective(step[None])[0] for step in steps])
    torch.testing.assert_close(objective(steps), alone)
