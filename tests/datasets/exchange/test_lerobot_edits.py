"""Changes of a LeRobot export that no decision can hold are refused by name."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from handsight.datasets import GraspDataset, InterchangeError, export_dataset, import_dataset


def change(name: str, value: Any, *, row: int = 2) -> Callable[[pd.DataFrame], pd.DataFrame]:
    def apply(table: pd.DataFrame) -> pd.DataFrame:
        table.at[row, name] = value
        return table

    return apply


REFUSED: dict[str, tuple[Callable[[pd.DataFrame], pd.DataFrame], str]] = {
    "action": (change("action", [0.9, 0.9, 0.9]), r"action is not what was recorded \(episode 2\)"),
    "state": (change("observation.state", [0.9, 0.9, 0.9]), r"observation.state is not what .* \(episode 2\)"),
    "reward": (change("next.reward", 0.5), r"next.reward is neither 0 nor 1 \(episode 2\)"),
    "index": (change("index", 3), r"index is not what was recorded \(episode 2\)"),
    "a row less": (lambda table: table.iloc[:-1], "there are 23 rows of 24 attempts"),
    "another order": (lambda table: table.iloc[::-1], "is not what was recorded"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_no_decision_can_hold_is_refused_by_name(dataset: GraspDataset, tmp_path: Path, name: str) -> None:
    edit, message = REFUSED[name]
    export_dataset(dataset, tmp_path / "out", format="lerobot")
    file = tmp_path / "out/data/chunk-000/file-000.parquet"
    edit(pd.read_parquet(file)).to_parquet(file)
    with pytest.raises(InterchangeError, match=message):
        import_dataset(tmp_path / "out", tmp_path / "back", dry_run=True)
