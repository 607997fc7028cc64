"""What the optimisers maximise: predicted success of a step from the current view (section III-A, eq. 3)."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

from handsight.servoing.homography import InputGrid, predict_inputs
from handsight.servoing.prepared_view import PreparedView
from handsight.servoing.view import View

ScoreInputs = Callable[[Tensor], Tensor]
"""A Grasp Quality Network: inputs (B, 4, size, size) to success metrics S in [0, 1], (B,)."""


class Objective:
    """S(dp) = Q(f(I_p, dp)) for one picture I_p."""

    def __init__(self, view: View, score_inputs: ScoreInputs, grid: InputGrid) -> None:
        """Prepare ``view`` once; every call then costs one resampling and one network pass for the whole batch."""
        self._prepared = PreparedView.from_view(view, pixels_per_cell=grid.pixels_per_cell)
        self._score_inputs = score_inputs
        self._grid = grid

    def __call__(self, steps: Tensor) -> Tensor:
        """Predicted success of every step (dx [m], dy [m], dangle [rad]). (B, 3) -> (B,)."""
        return self._score_inputs(self.inputs(steps))

    def inputs(self, steps: Tensor) -> Tensor:
        """The predicted pictures themselves. (B, 3) -> (B, 4, size, size)."""
        return predict_inputs(self._prepared, steps, grid=self._grid)

    def score_here(self) -> float:
        """S_0: predicted success of grasping without moving."""
        return float(self(torch.zeros(1, 3))[0])
