"""What a sweep found: means over trials, paired differences, and how each object was judged."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

from handsight.training.intervals import MeanOverTrials, mean_over_trials
from handsight.training.sweep.cell import Cell
from handsight.training.sweep.result import CellResult, ObjectScore

Results = Mapping[Cell, CellResult]


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepRow:
    """A point of the figure."""

    series: str
    """Channels, and what else differs."""
    channels: str
    size: int | None
    trained_on: float
    """Attempts, on average over the trials: they differ where the size is all that there are."""
    accuracy: MeanOverTrials
    """Balanced accuracy at S > 0.5."""
    auc: MeanOverTrials


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepDifference:
    """Two series at one size, trial by trial."""

    series: str
    against: str
    size: int | None
    accuracy: MeanOverTrials
    """Of the first less that of the second."""
    auc: MeanOverTrials


@dataclass(frozen=True, slots=True, kw_only=True)
class ObjectRow:
    """An object in all trials that held it out, at one size."""

    series: str
    size: int | None
    object: str
    attempts: int
    correct: int


def sweep_rows(results: Results, datasets: Sequence[str] = ()) -> list[SweepRow]:
    """A row for each series and size that has results, in the order of the cells.

    Args:
        results: By cell.
        datasets: What those of the plan are called, where there are several.
    """
    return [
        SweepRow(
            series=some[0][0].series(datasets),
            channels=some[0][0].channels,
            size=some[0][0].size,
            trained_on=sum(result.trained_on for _, result in some) / len(some),
            accuracy=_mean([result.tested.accuracy or 0.0 for _, result in some], some).as_share(),
            auc=_mean([result.tested.auc or 0.0 for _, result in some], some).as_share(),
        )
        for some in _points(results, datasets)
    ]


def sweep_differences(results: Results, datasets: Sequence[str] = ()) -> list[SweepDifference]:
    """Every two series that differ in one thing, at every size that both have a trial of."""
    points = {
        (some[0][0].series(datasets), some[0][0].size): {cell.trial: (cell, found) for cell, found in some}
        for some in _points(results, datasets)
    }
    differences = []
    for ((one, size), first), ((other, other_size), second) in combinations(points.items(), 2):
        common = sorted(first.keys() & second.keys())
        if size != other_size or not common or not _differ_in_one(first[common[0]][0], second[common[0]][0]):
            continue
        pairs = [(first[trial][1], second[trial][1]) for trial in common]
        some = [first[trial] for trial in common]
        differences.append(
            SweepDifference(
                series=one,
                against=other,
                size=size,
                accuracy=_mean([(a.tested.accuracy or 0.0) - (b.tested.accuracy or 0.0) for a, b in pairs], some),
                auc=_mean([(a.tested.auc or 0.0) - (b.tested.auc or 0.0) for a, b in pairs], some),
            )
        )
    return differences


def object_rows(results: Results, datasets: Sequence[str] = ()) -> list[ObjectRow]:
    """Every object at every point, the worst judged first."""
    rows = []
    for some in _points(results, datasets):
        judged: dict[str, list[ObjectScore]] = defaultdict(list)
        for _, result in some:
            for name, score in result.objects.items():
                judged[name].append(score)
        found = [
            ObjectRow(
                series=some[0][0].series(datasets),
                size=some[0][0].size,
                object=name,
                attempts=sum(score.attempts for score in scores),
                correct=sum(score.correct for score in scores),
            )
            for name, scores in judged.items()
        ]
        rows += sorted(found, key=lambda row: (row.correct / row.attempts, row.object))
    return rows


def _points(results: Results, datasets: Sequence[str]) -> list[list[tuple[Cell, CellResult]]]:
    """The results of each series and size, by size and then in the order of the series."""
    points: dict[tuple[str, int | None], list[tuple[Cell, CellResult]]] = defaultdict(list)
    for cell, result in results.items():
        points[cell.series(datasets), cell.size].append((cell, result))
    order = list(dict.fromkeys(series for series, _ in points))
    return [points[key] for key in sorted(points, key=lambda key: (key[1] is None, key[1] or 0, order.index(key[0])))]


def _mean(values: Sequence[float], some: Sequence[tuple[Cell, CellResult]]) -> MeanOverTrials:
    shares = [result.held_out_attempts / (result.held_out_attempts + result.pool) for _, result in some]
    return mean_over_trials(values, held_out=sum(shares) / len(shares))


def _differ_in_one(one: Cell, other: Cell) -> bool:
    varied = [a != b for a, b in zip(one.varied, other.varied, strict=True)]
    return sum([one.channels != other.channels, one.dataset != other.dataset, *varied]) == 1
