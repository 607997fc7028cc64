"""A trained network as the servo loop wants it: pictures in, success metrics S out."""

from __future__ import annotations

import torch
from torch import Tensor

from handsight.servoing.homography import InputGrid
from handsight.servoing.sweep import score_each_window
from handsight.training.errors import NetworkSettingsError, PictureError
from handsight.training.folded import folded
from handsight.training.gqn import GraspQualityNetwork
from handsight.training.memory import keep_freed_memory
from handsight.training.precision import Precision, dtype_for


class Scorer:
    """Scores inputs, and all crops of a picture, on the device of the network.

    The network's weights are copied, so training it further changes no score.
    """

    def __init__(self, network: GraspQualityNetwork, grid: InputGrid, *, precision: Precision = "float32") -> None:
        """Prepare ``network`` for inference.

        Args:
            network: The network.
            grid: Crop and size of the inputs that it was trained on.
            precision: In which numbers to compute. With ``bfloat16``, scores differ from those of ``float32`` by a few
                thousandths. What ``auto`` computes depends on the machine, and so would a session collected with it.

        Raises:
            NetworkSettingsError: The network reads pictures of another size, or there is no such precision.
        """
        if grid.size_px != network.config.size_px:
            raise NetworkSettingsError(
                f"the grid makes inputs of {grid.size_px} px, expected {network.config.size_px} px, which the network "
                "reads"
            )
        # Every batch of a servo step asks for megabytes and frees them: to clear them anew each time takes a third of
        # the full CEM.
        keep_freed_memory()
        self._folded = folded(network, dtype=dtype_for(precision, network.get_buffer("shift").device))
        self.grid = grid

    @property
    def dense(self) -> bool:
        """Whether maps are computed in one pass: without a border of zeros, which each window has of its own."""
        return not self._folded.config.padded

    @property
    def reach_px(self) -> int:
        """How many rows and columns of an input the scores depend on, from the first."""
        return self._folded.config.reach_px

    def __call__(self, inputs: Tensor) -> Tensor:
        """Scores of inputs (B, 4, size, size), or of what is read of them, (B, 4, reach, reach) -> (B,).

        Gradients reach inputs that require them; otherwise nothing is kept for them.
        """
        with torch.set_grad_enabled(torch.is_grad_enabled() and inputs.requires_grad):
            return torch.sigmoid(self._folded.logits(inputs))

    def score_map(self, picture: Tensor, *, every: int = 1) -> Tensor:
        """Scores of every window of a picture; for a network without padding in one pass over all of it.

        Args:
            picture: At the resolution of the network's inputs. Shape (4, H, W).
            every: Step between windows, in pixels.

        Returns:
            Entry (r, c) is the score of ``picture[:, every*r : every*r + size, every*c : every*c + size]``, equal to
            that of the window alone to 1e-4 in float32. Shape (R, C) with R = (H - size) // every + 1 and C likewise.

        Raises:
            PictureError: No window fits into the picture, it has no four channels, or the step is not positive.
        """
        size_px = self.grid.size_px
        if picture.ndim != 3 or len(picture) != 4 or min(picture.shape[1:]) < size_px or every < 1:
            raise PictureError(
                f"the picture has shape {tuple(picture.shape)} and windows are to begin every {every} px, expected "
                f"(4, H, W) with sides of at least {size_px} px, and a step of at least 1 px"
            )
        with torch.set_grad_enabled(torch.is_grad_enabled() and picture.requires_grad):
            if not self.dense:
                return score_each_window(self, picture, every=every)
            return torch.sigmoid(self._folded.logits_map(picture, every=every))
