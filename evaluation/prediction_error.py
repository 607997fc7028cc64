"""How wrong the input is that the homography predicts for a step: against the picture really taken after it (VI-E).

Two inputs of the network are compared, pixel by pixel and by what the network makes of them. One is predicted from the
picture before the step, as every servo method sees it; the other is made from the picture after the step. Both go
through the same crop and filter, so that a step of zero has no error at all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from handsight.evaluation.pixel_faults import PixelFaults, pixel_faults
from handsight.evaluation.point_cloud import predicted_by_points
from handsight.servoing.objective import Objective
from handsight.servoing.planar import PlanarStep
from handsight.servoing.scorer import GraspScorer
from handsight.servoing.view import View


@dataclass(frozen=True, slots=True, kw_only=True)
class PredictionError:
    """One predicted input against the true one."""

    colour_rms: float
    """Root mean square over pixels and colours, which are in [0, 1]."""
    height_rms_m: float
    """Root mean square over pixels of the height below the mean plane [m]."""
    predicted_score: float
    """What the network makes of the predicted input."""
    true_score: float
    """What it makes of the input of the picture that was taken."""
    faults: PixelFaults
    """Shares of pixels that are wrong, by their cause."""
    points_height_rms_m: float
    """As ``height_rms_m``, of the input that the point cloud predicts."""
    points_score: float
    """What the network makes of that."""

    @property
    def score_error(self) -> float:
        """Predicted less true: positive where the prediction promises too much."""
        return self.predicted_score - self.true_score

    @property
    def points_score_error(self) -> float:
        """The same of the point cloud's prediction."""
        return self.points_score - self.true_score


def prediction_error(before: View, after: View, step: PlanarStep, scorer: GraspScorer) -> PredictionError:
    """What the network would see after a step, predicted and in truth.

    Args:
        before: The picture from which is predicted.
        after: The picture taken after the step, from the same height.
        step: From the pose of the first picture to that of the second, as measured.
        scorer: The network.

    Raises:
        ImageError: A picture has no valid depth.
        ScoreError: A score is not in [0, 1].
    """
    ahead, there = Objective(before, scorer), Objective(after, scorer)
    by_points = Objective(predicted_by_points(before, step), scorer)
    steps = torch.tensor([[step.dx_m, step.dy_m, step.dangle_rad]], dtype=torch.float32)
    with torch.no_grad():
        predicted = ahead.inputs(steps)
        difference = predicted[0] - there.inputs_here()
        return PredictionError(
            colour_rms=_rms(difference[:3]),
            height_rms_m=_rms(difference[3]),
            predicted_score=float(ahead.scores(predicted)[0]),
            true_score=there.score_here(),
            faults=pixel_faults(before, after, step, grid=scorer.grid),
            points_height_rms_m=_rms((by_points.inputs_here() - there.inputs_here())[3]),
            points_score=by_points.score_here(),
        )


def height_at_grasp_m(view: View, *, camera_height_m: float, radius_m: float) -> float:
    """How high what lies under the fingertips rises above the table [m]; 0 for a bare table.

    Args:
        view: The picture taken from where is grasped.
        camera_height_m: Height of the camera above the table [m].
        radius_m: Places at most so far from the grasp point, seen from above, count [m].

    Returns:
        The highest of them; NaN where none has a valid depth.
    """
    k, camera = view.camera.intrinsics, view.camera
    x_m = (np.arange(k.width) - k.cx) / k.fx * view.depth_m + camera.x_tool_camera_m  # (H, W)
    y_m = ((np.arange(k.height) - k.cy) / k.fy)[:, None] * view.depth_m + camera.y_tool_camera_m
    near = view.valid & (x_m**2 + y_m**2 <= radius_m**2)
    return camera_height_m - float(view.depth_m[near].min()) if near.any() else float("nan")


def _rms(difference: Tensor) -> float:
    return float(difference.double().square().mean().sqrt())
