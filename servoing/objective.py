"""What the optimisers maximise: predicted success of a step from the current view (section III-A, eq. 3)."""

from __future__ import annotations

from torch import Tensor

from handsight.servoing.footprint import Footprint
from handsight.servoing.homography import predict_inputs
from handsight.servoing.prepared_view import PreparedView
from handsight.servoing.scorer import GraspScorer, PartScorer
from handsight.servoing.scores import check_scores
from handsight.servoing.sweep import Sweep, sweep
from handsight.servoing.view import View


class Objective:
    """S(dp) = Q(f(I_p, dp)) for one picture I_p."""

    def __init__(self, view: View, scorer: GraspScorer, *, view_plane_m: float | None = None) -> None:
        """Prepare ``view`` once; every call then costs one resampling and one network pass for the whole batch.

        Args:
            view: The picture.
            scorer: The network.
            view_plane_m: Distance of the plane at the height where grasps begin [m], for a picture that was taken at
                another one; None means that it was taken there.
        """
        self._view_plane_m = view_plane_m
        self._prepared = PreparedView.from_view(view, pixels_per_cell=scorer.grid.pixels_per_cell)
        self._scorer = scorer
        self._read_px = scorer.reach_px if isinstance(scorer, PartScorer) else scorer.grid.size_px
        self._here = self.inputs(self._prepared.channels.new_zeros(1, 3))

    def __call__(self, steps: Tensor) -> Tensor:
        """Predicted success of every step (dx [m], dy [m], dangle [rad]). (B, 3) -> (B,).

        Steps that require a gradient get one.

        Raises:
            ScoreError: A score is not in [0, 1], so that no step can be chosen by it.
        """
        return self.scores(self._predicted(steps, self._read_px))

    @property
    def footprint(self) -> Footprint:
        """What the picture shows, as steps of the gripper."""
        return Footprint.of(self._prepared.camera, plane_m=self._prepared.plane_m)

    def sweep(self, angle_rad: float, *, every: int = 1) -> Sweep:
        """Predicted success of every position in the picture at one angle, ``every`` network pixels apart.

        Raises:
            ServoSettingsError: The spacing is not positive, or the angle is not finite.
            ScoreError: A score is not in [0, 1].
        """
        return sweep(self._prepared, self._scorer, angle_rad=angle_rad, every=every, view_plane_m=self._view_plane_m)

    def inputs(self, steps: Tensor) -> Tensor:
        """The predicted pictures themselves. (B, 3) -> (B, 4, size, size)."""
        return self._predicted(steps, self._scorer.grid.size_px)

    def scores(self, inputs: Tensor) -> Tensor:
        """Predicted success of predicted pictures, or of what the network reads of them. (B, 4, side, side) -> (B,).

        Raises:
            ScoreError: A score is not in [0, 1].
        """
        scores = self._scorer(inputs)
        check_scores(scores.numpy(force=True), len(inputs))
        return scores

    def inputs_here(self) -> Tensor:
        """The network's input without moving. Shape (4, size, size)."""
        return self._here[0]

    def score_here(self) -> float:
        """S_0: predicted success of grasping without moving."""
        return float(self.scores(self._here)[0])

    def _predicted(self, steps: Tensor, side_px: int) -> Tensor:
        grid, plane_m = self._scorer.grid, self._view_plane_m
        return predict_inputs(self._prepared, steps, grid=grid, view_plane_m=plane_m, side_px=side_px)
