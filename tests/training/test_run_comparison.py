from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from tests.support.drawn import SMALL
from tests.support.runs import ORIGIN, save_untrained

from handsight.training.run_comparison import differences, held_out_alike
from handsight.training.run_folder import RUN_RECORD
from handsight.training.run_record import read_values


def saved(folder: Path, **changes: Any) -> dict[str, Any]:
    save_untrained(folder, **changes)
    return read_values(folder / RUN_RECORD)


def test_runs_differ_in_what_they_were_made_of(tmp_path: Path) -> None:
    near = replace(ORIGIN, view="pregrasp")
    first = saved(tmp_path / "a")
    second = saved(tmp_path / "b", batch=16, origins=(replace(ORIGIN, snapshot="XYZ"), near))
    third = saved(tmp_path / "c", network=replace(SMALL.network, widths=(8, 16)))
    found = {one.name: one.values for one in differences([first, second, third])}
    assert found == {
        "origins[0].snapshot": ("ABCDEFGH", "XYZ", "ABCDEFGH"),
        **{f"origins[1].{name}": (None, value, None) for name, value in near.to_json().items()},
        "settings.network.widths": ([8, 8], [8, 8], [8, 16]),
        "settings.batch": (32, 16, 32),
    }


def test_a_run_does_not_differ_from_itself_or_its_copy(tmp_path: Path) -> None:
    assert differences([saved(tmp_path / "a"), saved(tmp_path / "b")]) == []


@pytest.mark.parametrize(
    ("changes", "alike"),
    [
        ({"batch": 16}, True),
        ({"origins": (replace(ORIGIN, dataset="copy@v1", snapshot="XYZ"),)}, True),
        ({"seed": 1}, False),
        ({"holdout": 0.1}, False),
        ({"origins": (replace(ORIGIN, digest="e" * 64),)}, False),
        ({"origins": (replace(ORIGIN, view="pregrasp"),)}, False),
    ],
)
def test_figures_compare_where_the_same_attempts_were_held_out(
    tmp_path: Path, changes: dict[str, Any], alike: bool
) -> None:
    assert held_out_alike([saved(tmp_path / "a"), saved(tmp_path / "b", **changes)]) == alike
