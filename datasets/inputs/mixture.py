"""Inputs of several datasets, or of several pictures of the same attempts, as one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from handsight.datasets.inputs.materialize import GraspInputs
from handsight.datasets.inputs.twins import TWIN_COLUMNS


class InputRows(Protocol):
    """What rows of inputs can be gathered from: an array, or several as if they were one."""

    @property
    def shape(self) -> tuple[int, ...]:
        """(N, 4, size, size)."""

    def __getitem__(self, rows: NDArray[np.int64], /) -> NDArray[np.float16]:
        """The inputs at some positions, in that order. (M,) -> (M, 4, size, size)."""


class LabelledInputs(Protocol):
    """What a network is trained on: :class:`GraspInputs` of one version, or several of them mixed."""

    @property
    def inputs(self) -> InputRows:
        """Of every attempt and picture. Shape (N, 4, size, size)."""

    @property
    def attempts(self) -> pd.DataFrame:
        """The rows of the attempts tables that they belong to, in the same order."""

    @property
    def labels(self) -> NDArray[np.float32]:
        """1 where the grasp succeeded. Shape (N,)."""

    @property
    def file(self) -> Path | None:
        """The file that the inputs are mapped from, if it is one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MixedInputs:
    """All inputs of some parts, one part after another. No part is copied; rows are gathered where they are.

    The same attempt may be in several parts: in two pictures, or in two datasets, one of which was merged into the
    other.
    """

    inputs: StackedInputs
    attempts: pd.DataFrame
    file: None = None

    @property
    def labels(self) -> NDArray[np.float32]:
        """1 where the grasp succeeded. Shape (N,)."""
        return self.attempts["success"].to_numpy(dtype=np.float32)


class StackedInputs:
    """Arrays as if they were one, on top of each other.

    Args:
        parts: At least one. Shapes (N_i, 4, size, size).
    """

    def __init__(self, parts: Sequence[NDArray[np.float16]]) -> None:
        self._parts = tuple(parts)
        self._starts = np.cumsum([0, *(len(part) for part in parts)])

    @property
    def shape(self) -> tuple[int, ...]:
        """As of one array."""
        return int(self._starts[-1]), *self._parts[0].shape[1:]

    def __getitem__(self, rows: NDArray[np.int64], /) -> NDArray[np.float16]:
        """The rows at some positions, in that order. (M,) -> (M, 4, size, size)."""
        gathered = np.empty((len(rows), *self.shape[1:]), np.float16)
        part_of_row = np.searchsorted(self._starts, rows, side="right") - 1
        for at in np.unique(part_of_row):
            own = part_of_row == at
            gathered[own] = self._parts[at][rows[own] - self._starts[at]]
        return gathered


def mixed(parts: Sequence[GraspInputs]) -> LabelledInputs:
    """All inputs of some parts.

    Args:
        parts: At least one, with inputs of one size.

    Raises:
        ValueError: There is no part, or their inputs differ in size.
    """
    sizes = {part.inputs.shape[1:] for part in parts}
    if len(sizes) != 1:
        raise ValueError(f"inputs have {len(sizes)} sizes ({sorted(sizes)}), expected one: materialize on one grid")
    if len(parts) == 1:
        return parts[0]
    return MixedInputs(
        inputs=StackedInputs([part.inputs for part in parts]),
        attempts=mixed_attempts([part.attempts for part in parts]),
    )


def mixed_attempts(tables: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """What is asked of attempts of several datasets, one table after another: other columns can be of several types."""
    columns = ("success", *TWIN_COLUMNS)
    return pd.concat([table[[name for name in columns if name in table]] for table in tables])
