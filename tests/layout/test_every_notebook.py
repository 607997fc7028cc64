"""The notebooks run from their first cell to their last, in a folder and with a cache of their own."""

from __future__ import annotations

import json
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
import pytest

NOTEBOOKS = Path(__file__).resolve().parents[2] / "docs" / "notebooks"
SMALLER = {"ATTEMPTS = 24": "ATTEMPTS = 6", "ATTEMPTS, EPOCHS = 120, 6": "ATTEMPTS, EPOCHS = 24, 1"}
"""What is made smaller here: a test shows that it runs, not what it learns."""


def cells(path: Path) -> list[str]:
    notebook = json.loads(path.read_text())
    return ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]


@pytest.mark.parametrize("path", sorted(NOTEBOOKS.glob("*.ipynb")), ids=lambda path: path.stem)
def test_a_notebook_runs(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HANDSIGHT_CACHE", str(tmp_path / "cache"))
    backend = mpl.get_backend()
    mpl.use("Agg")
    names: dict[str, object] = {"__name__": "__main__"}
    try:
        for number, source in enumerate(cells(path), start=1):
            for large, small in SMALLER.items():
                source = source.replace(large, small)
            exec(compile(source, f"{path.name}, cell {number}", "exec"), names)
    finally:
        plt.close("all")
        mpl.use(backend)


@pytest.mark.parametrize("path", sorted(NOTEBOOKS.glob("*.ipynb")), ids=lambda path: path.stem)
def test_a_notebook_is_kept_without_what_it_printed(path: Path) -> None:
    notebook = json.loads(path.read_text())
    kept = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert [cell["outputs"] for cell in kept] == [[]] * len(kept)
    assert {cell["execution_count"] for cell in kept} == {None}


def test_there_are_three() -> None:
    assert len(list(NOTEBOOKS.glob("*.ipynb"))) == 3
