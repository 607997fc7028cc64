from __future__ import annotations

from dataclasses import replace

import pytest

from handsight.training.metrics import Metrics
from handsight.training.sweep.cell import Cell
from handsight.training.sweep.result import CellResult, ObjectScore
from handsight.training.sweep.table import object_rows, sweep_differences, sweep_rows


def results(accuracies: dict[tuple[str, int | None, int], float]) -> dict[Cell, CellResult]:
    return {
        Cell(dataset=0, channels=channels, size=size, trial=trial): CellResult(
            tested=Metrics(attempts=8, accuracy=accuracy, auc=accuracy, loss=0.5),
            predictions=(),
            objects={
                "cup": ObjectScore(attempts=4, correct=round(4 * accuracy)),
                "egg": ObjectScore(attempts=2, correct=2),
            },
            curve=(),
            epochs=3,
            kept_epoch=1,
            trained_on=size or 80,
            held_out_attempts=20,
            pool=80,
            seconds=1.0,
            processor_s=1.0,
        )
        for (channels, size, trial), accuracy in accuracies.items()
    }


FOUND = results(
    {
        ("rgb", 50, 0): 0.6,
        ("rgb", 50, 1): 0.7,
        ("depth", 50, 0): 0.8,
        ("depth", 50, 1): 0.8,
        ("depth", 50, 2): 1.0,
        ("rgb", None, 0): 0.9,
        ("rgb", 7, 0): 0.5,
    }
)


def test_rows_are_means_by_size_with_all_attempts_last() -> None:
    rows = sweep_rows(FOUND)
    assert [(row.series, row.size, row.accuracy.trials) for row in rows] == [
        ("rgb", 7, 1),
        ("rgb", 50, 2),
        ("depth", 50, 3),
        ("rgb", None, 1),
    ]
    assert rows[1].accuracy.mean == pytest.approx(0.65)
    assert rows[3].trained_on == 80


def test_series_of_several_datasets_are_called_by_them() -> None:
    twice = {**FOUND, **{replace(cell, dataset=1): result for cell, result in FOUND.items()}}
    named = ("clean@v1", "noisy@v1")
    at_50 = [row.series for row in sweep_rows(twice, named) if row.size == 50]
    assert at_50 == ["rgb clean@v1", "depth clean@v1", "rgb noisy@v1", "depth noisy@v1"]
    pairs = {(row.series, row.against) for row in sweep_differences(twice, named) if row.size == 50}
    assert ("rgb clean@v1", "rgb noisy@v1") in pairs
    assert ("rgb clean@v1", "depth noisy@v1") not in pairs


def test_no_interval_of_a_share_leaves_nought_to_one() -> None:
    row = next(row for row in sweep_rows(FOUND) if (row.series, row.size) == ("depth", 50))
    assert row.accuracy.high == 1.0
    difference = sweep_differences(
        results({("rgb", 50, 0): 0.1, ("rgb", 50, 1): 0.9, ("depth", 50, 0): 0.9, ("depth", 50, 1): 0.1})
    )[0]
    assert difference.accuracy.low is not None
    assert difference.accuracy.low < -1


def test_differences_are_of_trials_that_both_have() -> None:
    (difference,) = sweep_differences(FOUND)
    assert (difference.series, difference.against, difference.size) == ("rgb", "depth", 50)
    assert difference.accuracy.trials == 2
    assert difference.accuracy.mean == pytest.approx(-0.15)


def test_series_that_differ_in_two_things_are_not_compared() -> None:
    varied = {replace(cell, varied=(("mixup", "0"),)): result for cell, result in FOUND.items()}
    other = {replace(cell, varied=(("mixup", "1"),)): result for cell, result in FOUND.items()}
    found = sweep_differences({**varied, **other})
    pairs = {(row.series, row.against) for row in found if row.size == 50}
    assert pairs == {
        ("rgb mixup=0", "depth mixup=0"),
        ("rgb mixup=1", "depth mixup=1"),
        ("rgb mixup=0", "rgb mixup=1"),
        ("depth mixup=0", "depth mixup=1"),
    }


def test_objects_are_counted_over_trials_and_the_worst_comes_first() -> None:
    rows = [row for row in object_rows(FOUND) if (row.series, row.size) == ("rgb", 50)]
    assert [(row.object, row.correct, row.attempts) for row in rows] == [("cup", 5, 8), ("egg", 4, 4)]
