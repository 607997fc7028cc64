"""Network inputs for people with a training loop of their own: a plain ``torch.utils.data.Dataset``.

It touches nothing but the memory-mapped cache, never Icechunk, so it works in workers of a ``DataLoader`` started by
fork and by spawn alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.utils.data import Dataset

from handsight.datasets.inputs.augmentation import FLIPS, flipped
from handsight.datasets.inputs.cache import mapped_again
from handsight.datasets.inputs.mixture import InputRows, LabelledInputs

Batch = tuple[Tensor, Tensor]
"""Inputs (B, 4, size, size), float16, and labels (B,), float32; without B for a single index."""


class TorchGrasps(Dataset[Batch]):
    """Inputs and labels by position in ``GraspInputs.attempts``.

    An integer gives one sample, so that ``DataLoader(dataset, batch_size=…)`` works. A sequence of integers gives a
    batch in one gather, many times as fast: it is what ``DataLoader(dataset, sampler=…, batch_size=None)`` asks for
    with a sampler that yields lists.
    """

    def __init__(self, data: LabelledInputs) -> None:
        self._labels = torch.from_numpy(data.labels)
        self._inputs: InputRows = data.inputs
        self._file = data.file

    def __len__(self) -> int:
        return len(self._labels)

    def __getitem__(self, index: int | Sequence[int] | NDArray[np.int64]) -> Batch:
        # NumPy gathers several times as fast as torch, which does not ask for huge pages.
        positions = np.atleast_1d(np.asarray(index, dtype=np.int64))
        inputs = torch.from_numpy(np.asarray(self._inputs[positions]))
        labels = self._labels[torch.from_numpy(positions)]
        return (inputs[0], labels[0]) if np.ndim(index) == 0 else (inputs, labels)

    def __getstate__(self) -> dict[str, Any]:
        """What a spawned worker gets: the name of the mapped file, not its content."""
        inputs = None if self._file else self._inputs
        return {"labels": self._labels, "file": self._file, "shape": self._inputs.shape, "inputs": inputs}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Map the file again. Its bytes were checked when it was opened, and are not for every worker.

        Raises:
            CorruptDataError: It does not hold what it held, or another number of inputs than there are labels.
        """
        self._labels, self._file = state["labels"], state["file"]
        if self._file is None:
            self._inputs = state["inputs"]
        else:
            self._inputs = mapped_again(self._file, shape=state["shape"], dtype=np.float16)


class FlippedGrasps(TorchGrasps):
    """Every attempt in all four flips (section V-A): position i is attempt i // ``FLIPS`` in flip i % ``FLIPS``.

    An epoch of a :class:`~handsight.datasets.inputs.loader.GraspLoader` over it sees every attempt in each flip once.
    """

    @staticmethod
    def positions(attempts: NDArray[np.int64]) -> NDArray[np.int64]:
        """Positions of all flips of some attempts, such as those of a training fold. (M,) -> (4 M,)."""
        return (FLIPS * attempts[:, None] + np.arange(FLIPS)).ravel()

    def __len__(self) -> int:
        return FLIPS * super().__len__()

    def __getitem__(self, index: int | Sequence[int] | NDArray[np.int64]) -> Batch:
        positions = np.atleast_1d(np.asarray(index, dtype=np.int64))
        inputs, labels = super().__getitem__(positions // FLIPS)
        inputs = flipped(inputs, torch.from_numpy(positions % FLIPS))
        return (inputs[0], labels[0]) if np.ndim(index) == 0 else (inputs, labels)
