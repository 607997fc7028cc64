"""Spoilt input for everything that reads what it did not write: it is read or refused, and never ends in a traceback.

``python -P tests/support/fuzz.py --parser NAME --inputs 20000`` tries more, in children whose time and memory are
watched; there, ``--index`` tries one input again.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.support.fuzz import Workbench
from tests.support.fuzz_parsers import PARSERS

INPUTS = 100
FEWER = {
    **{"options": 50, "stored": 20, "refs": 50, "columns": 30, "attributes": 20, "cache": 40, "zarr": 40},
    **{"environment": 50, "pictures": 50, "hdf5": 20, "hdf5-set": 40, "lerobot": 40, "lerobot-set": 40},
}
"""Of those that run whole commands on a dataset; each of them takes a tenth of a second and more."""


@pytest.mark.parametrize("name", PARSERS)
def test_good_input_is_accepted(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HANDSIGHT_CACHE", str(tmp_path / "cache"))
    Workbench(name, tmp_path).accept()


@pytest.mark.no_cover
@pytest.mark.parametrize("name", PARSERS)
def test_spoilt_input_is_read_or_refused(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HANDSIGHT_CACHE", str(tmp_path / "cache"))
    bench = Workbench(name, tmp_path)
    outcomes = {index: bench.outcome(0, index) for index in range(FEWER.get(name, INPUTS))}
    assert {index: error for index, (outcome, error) in outcomes.items() if outcome == "traceback"} == {}
