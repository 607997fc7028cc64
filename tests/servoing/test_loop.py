"""The closed loop on a drawn table: one bright disc that the gripper should end up over."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation
from tests.support.drawn_table import DISC_XY_M, GRID, START, DrawnTable, brightness_in_the_middle
from tests.support.scorers import FunctionScorer
from torch import Tensor

from handsight.datasets.records import RgbdFrame
from handsight.evaluation.turned_camera import turned_frame
from handsight.servoing.errors import ScoreError, ServoSettingsError
from handsight.servoing.homography import InputGrid
from handsight.servoing.loop import ServoSettings, ServoTrace, servo
from handsight.servoing.methods.cem import Cem
from handsight.servoing.methods.first_order import FirstOrder
from handsight.servoing.methods.global_first import GlobalFirst, GlobalSearch
from handsight.servoing.optimiser import ServoMethod
from handsight.servoing.planar import PlanarPose
from handsight.servoing.view import View


def run(
    world: DrawnTable,
    method: Cem | FirstOrder,
    function: Callable[[Tensor], Tensor] = brightness_in_the_middle,
) -> ServoTrace:
    return servo(
        world.look,
        world.move,
        FunctionScorer(function, GRID),
        ServoMethod(name="test", label="test", settings=method),
        settings=ServoSettings(threshold=0.95),
        rng=np.random.default_rng(0),
    )


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

    trace = run(world, Cem(max_steps=6), function=dims)
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


def test_where_the_workspace_ends_a_part_of_the_step_is_taken() -> None:
    world = DrawnTable(START)
    asked: list[PlanarPose] = []

    def move(pose: PlanarPose) -> bool:
        asked.append(pose)
        return len(asked) > 1 and world.move(pose)

    scorer = FunctionScorer(brightness_in_the_middle, GRID)
    method = ServoMethod(name="test", label="test", settings=Cem())
    trace = servo(world.look, move, scorer, method, settings=ServoSettings(), rng=np.random.default_rng(0))
    assert world.visited[0] == asked[1] == trace.steps[1].pose
    assert asked[1].x_m - START.x_m == pytest.approx(0.5 * (asked[0].x_m - START.x_m))
    assert asked[1].angle_rad - START.angle_rad == pytest.approx(0.5 * (asked[0].angle_rad - START.angle_rad))


def test_a_method_may_move_before_anything_is_grasped() -> None:
    """The global first step leaves a good start for the best pose there is."""
    world = DrawnTable(PlanarPose(x_m=DISC_XY_M[0], y_m=DISC_XY_M[1] + 0.008, angle_rad=0.0))
    scorer = FunctionScorer(brightness_in_the_middle, GRID)
    method = ServoMethod(name="test", label="test", settings=GlobalFirst(search=GlobalSearch(angles=2)))
    trace = servo(world.look, world.move, scorer, method, settings=ServoSettings(), rng=np.random.default_rng(0))
    assert trace.steps[0].score >= 0.95
    assert trace.moves == 1
    assert trace.grasp_score > trace.steps[0].score


def test_a_step_keeps_what_it_predicted_and_what_it_took() -> None:
    world = DrawnTable(START)
    trace = run(world, Cem())
    first, second = trace.steps[:2]
    assert first.predicted_inputs is not None
    seen = (first.predicted_inputs - second.inputs).abs()[:, 8:24, 8:24]
    assert float(seen.max()) < 0.02, "flat things look as the homography says"
    assert trace.steps[-1].predicted_inputs is None
    assert all(step.look_s >= 0 and step.compute_s > 0 for step in trace.steps)


@pytest.mark.parametrize("threshold", [0.0, -1.0, 1.5])
def test_impossible_thresholds_are_refused(threshold: float) -> None:
    with pytest.raises(ServoSettingsError, match="expected in"):
        ServoSettings(threshold=threshold)


@pytest.mark.parametrize("method", [Cem(), FirstOrder()], ids=["cem", "first-order"])
@pytest.mark.parametrize("bad", [torch.nan, torch.inf, -0.5, 1.5])
def test_a_score_that_is_none_ends_the_run_before_any_grasp(method: Cem | FirstOrder, bad: float) -> None:
    """One among many is enough: CEM could choose it, and a gradient through it is none."""
    world = DrawnTable(START)

    def one_bad(inputs: Tensor) -> Tensor:
        scores = 0.5 * brightness_in_the_middle(inputs)
        return scores if len(scores) == 1 else torch.cat([scores[:-1], scores.new_tensor([bad])])

    with pytest.raises(ScoreError, match=rf"1 of {method.samples} scores of a network are not in \[0, 1\]"):
        run(world, method, one_bad)
    with pytest.raises(ScoreError, match="1 of 1 score of"):
        run(world, method, lambda inputs: torch.full((len(inputs),), bad))
    assert world.visited == []


def test_the_grid_is_the_scorers() -> None:
    world = DrawnTable(START)
    sizes: set[tuple[int, ...]] = set()

    def watch(inputs: Tensor) -> Tensor:
        sizes.add(tuple(inputs.shape[1:]))
        return torch.full((len(inputs),), 0.5)

    scorer = FunctionScorer(watch, InputGrid(crop_px=80, size_px=20))
    method = ServoMethod(name="test", label="test", settings=Cem(max_steps=1))
    servo(world.look, world.move, scorer, method, settings=ServoSettings(), rng=np.random.default_rng(0))
    assert sizes == {(4, 20, 20)}


def test_with_one_look_the_step_is_grasped_unseen() -> None:
    world = DrawnTable(START)
    scorer = FunctionScorer(brightness_in_the_middle, GRID)
    method = ServoMethod(name="test", label="test", settings=Cem())
    settings, rng = ServoSettings(), np.random.default_rng(0)
    trace = servo(world.look, world.move, scorer, method, settings=settings, rng=rng, looks=1)
    assert (len(trace.steps), trace.moves) == (1, 1)
    assert trace.grasp_pose == world.pose == world.visited[-1]
    assert trace.grasp_score == pytest.approx(trace.steps[0].predicted, abs=1e-5)
    assert trace.steps[0].score < trace.grasp_score


DEPTH_UNIT_M = 1e-5


class KnockedTable(DrawnTable):
    """The table by a camera that is tilted and believed to look straight down."""

    def look(self) -> tuple[View, PlanarPose]:
        view, pose = super().look()
        depth = np.rint(view.depth_m / DEPTH_UNIT_M).astype(np.uint16)
        frame = RgbdFrame(rgb=view.rgb, depth=depth, pose_base_tool=np.eye(4))
        tilt = Rotation.from_euler("xy", [5.0, 3.0], degrees=True).as_matrix()
        seen = turned_frame(frame, view.camera.intrinsics, tilt)
        return replace(view, rgb=seen.rgb, depth_m=(seen.depth * DEPTH_UNIT_M).astype(np.float32)), pose


@pytest.mark.parametrize("level", [False, True])
def test_a_knocked_camera_leads_astray_unless_views_are_levelled(level: bool) -> None:
    world = KnockedTable(START)
    trace = servo(
        world.look,
        world.move,
        FunctionScorer(brightness_in_the_middle, GRID),
        ServoMethod(name="test", label="test", settings=Cem()),
        settings=ServoSettings(threshold=0.95, level=level),
        rng=np.random.default_rng(0),
    )
    away_m = np.hypot(world.pose.x_m - DISC_XY_M[0], world.pose.y_m - DISC_XY_M[1])
    assert trace.confident
    assert away_m < 0.02 if level else away_m > 0.03


def test_settings_are_kept_as_sessions_from_before_levelling_keep_them() -> None:
    assert ServoSettings(threshold=0.9).to_json() == {"threshold": 0.9}
    for settings in (ServoSettings(threshold=0.9), ServoSettings(threshold=0.9, level=True)):
        assert ServoSettings.from_json(settings.to_json()) == settings
