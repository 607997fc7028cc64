"""The seam between this room and a trained network."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

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


@runtime_checkable
class PartScorer(GraspScorer, Protocol):
    """A scorer that reads the first rows and columns of its inputs alone, so that the others need not be made."""

    @property
    def reach_px(self) -> int:
        """How many rows and columns its scores depend on; it takes inputs that are no larger. (B, 4, reach, reach)."""


@runtime_checkable
class MapScorer(GraspScorer, Protocol):
    """A scorer that can score all crops of a picture at once, for less than one by one."""

    @property
    def dense(self) -> bool:
        """Whether it really does: a network whose borders are its own has to look at each crop by itself."""

    def score_map(self, picture: Tensor, *, every: int = 1) -> Tensor:
        """Scores of the windows of a picture at the resolution of the inputs, one at every ``every``-th pixel.

        Entry (r, c) is the score of ``picture[:, every*r : every*r + size, every*c : every*c + size]``, to 1e-4 what
        the scorer gives for that crop alone. (4, H, W) -> ((H - size) // every + 1, (W - size) // every + 1).
        """
