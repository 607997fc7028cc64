"""Functions of network inputs in the part of a trained network."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from torch import Tensor

from handsight.servoing.homography import InputGrid


@dataclass(frozen=True, slots=True)
class FunctionScorer:
    """Scores inputs of a grid with a function."""

    function: Callable[[Tensor], Tensor]
    grid: InputGrid = field(default_factory=InputGrid)

    def __call__(self, inputs: Tensor) -> Tensor:
        """(B, 4, size, size) -> (B,)."""
        return self.function(inputs)
