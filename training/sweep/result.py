"""What became of a cell, as its folder keeps it."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Self

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
class Prediction:
    """What a network said of an attempt that it never saw."""

    attempt: str
    group: str
    """What was held out with it: its target, unless groups are by something else."""
    success: bool
    score: float


@dataclass(frozen=True, slots=True, kw_only=True)
class CellResult:
    """How good the network of a cell is on objects that it never saw."""

    tested: Metrics
    """On the balanced test set of the trial; with its accuracy and area under the curve."""
    predictions: tuple[Prediction, ...]
    """Of the test set, in its order."""
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
        """As JSON values, without the curve and the predictions."""
        values = asdict(self)
        del values["curve"], values["predictions"]
        return values

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> Self:
        """From what :meth:`to_json` gave; the curve and the predictions are files of their own.

        Raises:
            KeyError, TypeError: A value is missing, or there is one that this handsight does not know.
        """
        objects = {name: ObjectScore(**one) for name, one in values["objects"].items()}
        return cls(
            **{**values, "tested": Metrics(**values["tested"]), "objects": objects, "curve": (), "predictions": ()}
        )


def object_scores(predictions: Sequence[Prediction]) -> dict[str, ObjectScore]:
    """How each object of a test set was judged, by name."""
    judged: dict[str, list[bool]] = {}
    for one in predictions:
        judged.setdefault(one.group, []).append((one.score > THRESHOLD) == one.success)
    return {name: ObjectScore(attempts=len(judged[name]), correct=sum(judged[name])) for name in sorted(judged)}


def predictions_csv(predictions: Sequence[Prediction]) -> str:
    """A line for each attempt of a test set."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("attempt", "group", "success", "score"))
    writer.writerows((one.attempt, one.group, int(one.success), one.score) for one in predictions)
    return text.getvalue()


def curve_csv(curve: Sequence[Epoch]) -> str:
    """A line for each pass."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("epoch", "train_loss", "held_out_loss", "held_out_auc", "held_out_accuracy"))
    for epoch in curve:
        held_out = epoch.held_out
        writer.writerow((epoch.number, epoch.train_loss, held_out.loss, held_out.auc, held_out.accuracy))
    return text.getvalue()
