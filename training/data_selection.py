"""Which attempts of the datasets a network is trained on, where it is not all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from handsight.datasets.curation.folds import read_folds
from handsight.datasets.errors import counted
from handsight.datasets.format.saved_filters import read_filters
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.reading.selection import expressions, matches
from handsight.training.errors import TrainingDataError


@dataclass(frozen=True, slots=True, kw_only=True)
class DataSelection:
    """A part of some datasets."""

    where: str = ""
    """Expression over the attempts table; empty for all."""
    filter: str = ""
    """Name of a saved filter; empty for none. With ``where``, both must hold."""
    folds: str = ""
    """Name of stored folds; empty for none."""
    fold: int = 0
    """Of these, the one that is held out: nothing of it is trained on."""
    size: int | None = None
    """So many attempts, drawn by the seed of the training; None for all."""

    def __post_init__(self) -> None:
        if self.size is not None and self.size < 2:
            raise TrainingDataError(f"size is {self.size}, expected at least 2 attempts")

    @property
    def is_all(self) -> bool:
        """Whether nothing is left out."""
        return self == DataSelection()

    def to_json(self) -> dict[str, Any]:
        """As JSON values."""
        return asdict(self)

    def chosen(self, dataset: GraspDataset, rows: pd.DataFrame) -> NDArray[np.bool_]:
        """Which of a dataset's rows are meant, but for the size. Shape (N,).

        Raises:
            WhereError: The expression is not sound.
            UnknownNameError: There is no such filter, or there are no such folds.
            FoldsError: The folds do not fit the version, or there is no such fold.
        """
        mask = np.ones(len(rows), dtype=bool)
        for where in expressions(self.where, self.filter, read_filters(dataset.root) if self.filter else {}):
            mask &= matches(rows, where).to_numpy(dtype=bool)
        if self.folds:
            learnt, _ = read_folds(dataset, self.folds).split(self.fold)
            mask &= rows.index.isin(learnt)
        return mask

    def rows(self, masks: Sequence[NDArray[np.bool_]], attempts: pd.Index[str], seed: int) -> NDArray[np.int64]:
        """Positions in several parts, one after another, of what is meant; all inputs of an attempt, or none.

        Args:
            masks: As :meth:`chosen` gave for each part.
            attempts: Ids of all parts, one after another. Shape (N,).
            seed: From which ``size`` attempts are drawn.

        Returns:
            Ascending. Shape (M,).

        Raises:
            TrainingDataError: Nothing is meant, or there are fewer attempts than ``size``.
        """
        rows = np.flatnonzero(np.concatenate(list(masks)))
        names = attempts[rows].unique()
        if not len(names) or (self.size is not None and self.size > len(names)):
            wanted = "some" if self.size is None else f"at least the {self.size} of --size"
            raise TrainingDataError(
                f"the selection holds {counted(len(names), 'labelled attempt')}, expected {wanted}: select more"
            )
        if self.size is None:
            return rows
        drawn = np.random.default_rng([seed % 2**64, 2]).choice(len(names), self.size, replace=False)
        return rows[attempts[rows].isin(names[drawn])]


EVERYTHING = DataSelection()
