"""What became of a cell, as its folder keeps it."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from handsight.training.course import Epoch
from handsight.training.metrics import Metrics

THRESHOLD = 0.5
"""Score above which a grasp counts as predicted to succeed (figure 7)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ObjectScore:
    """How an object that was held out was judged."""

    attempts: int
    """In the test set."""
    correct: int


@dataclass(frozen=True, slots=True, kw_only=True)
class CellResult:
    """How good the network of a cell is on objects that it never saw."""

    tested: Metrics
    """On the balanced test set of the trial; with its accuracy and area under the curve."""
    objects: dict[str, ObjectScore]
    """By what groups are by: targets, unless told otherwise."""
    curve: tuple[Epoch, ...]
    epochs: int
    """Passes that there were."""
    kept_epoch: int
    trained_on: int
    held_out_attempts: int
    """Attempts of the groups held out, of which the test set is a draw."""
    pool: int
    """Attempts that could be trained on."""
    seconds: float
    """Of the clock, from the first batch to the last score, without what was done before an interruption."""
    processor_s: float
    """Likewise, of the processor."""

    def to_json(self) -> dict[str, Any]:
        """As JSON values, without the curve."""
        values = asdict(self)
        del values["curve"]
        return values

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> Self:
        """From what :meth:`to_json` gave; the curve is a file of its own.

        Raises:
            KeyError, TypeError: A value is missing, or there is one that this handsight does not know.
        """
        objects = {name: ObjectScore(**one) for name, one in values["objects"].items()}
        return cls(**{**values, "tested": Metrics(**values["tested"]), "objects": objects, "curve": ()})


def object_scores(
    groups: Sequence[str], scores: NDArray[np.float32], labels: NDArray[np.float32]
) -> dict[str, ObjectScore]:
    """How each object of a test set was judged, by name."""
    correct = (scores > THRESHOLD) == (labels == 1)
    names = np.asarray(groups, dtype=object)
    return {
        str(name): ObjectScore(attempts=int((names == name).sum()), correct=int(correct[names == name].sum()))
        for name in sorted(set(groups))
    }


def curve_csv(curve: Sequence[Epoch]) -> str:
    """A line for each pass."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("epoch", "train_loss", "held_out_loss", "held_out_auc", "held_out_accuracy"))
    for epoch in curve:
        held_out = epoch.held_out
        writer.writerow((epoch.number, epoch.train_loss, held_out.loss, held_out.auc, held_out.accuracy))
    return text.getvalue()
