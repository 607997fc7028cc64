"""The seam between this room and a trained network."""

from __future__ import annotations

from typing import Protocol

from torch import Tensor

from handsight.servoing.homography import InputGrid


class GraspScorer(Protocol):
    """A Grasp Quality Network, with the crop and size of the pictures that it was trained on.

    Whoever shows it pictures takes the grid from here: at another crop things have another size, and the scores of a
    network that learnt the first mean nothing.
    """

    @property
    def grid(self) -> InputGrid:
        """Crop and size of its inputs."""

    def __call__(self, inputs: Tensor) -> Tensor:
        """Success metrics S in [0, 1] of a batch. (B, 4, size, size) -> (B,).

        Gradients reach inputs that require them.
        """
