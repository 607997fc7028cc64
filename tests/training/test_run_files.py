from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from tests.support.runs import save_untrained

from handsight.training.run_files import FileCheck, check_files
from handsight.training.run_folder import CARD, NEXT_WEIGHTS, RUN_RECORD, WEIGHTS
from handsight.training.run_record import WEIGHTS_SHA256, read_values


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    save_untrained(tmp_path / "run")
    return tmp_path / "run"


def checked(folder: Path) -> FileCheck:
    return check_files(folder, read_values(folder / RUN_RECORD))


def test_a_whole_run(folder: Path) -> None:
    assert checked(folder) == FileCheck(weights=WEIGHTS, weights_fault=None, weights_named=True, card="current")


def test_weights_of_another_run(folder: Path, tmp_path: Path) -> None:
    save_untrained(tmp_path / "other", seed=1)
    shutil.copy(tmp_path / "other" / WEIGHTS, folder / WEIGHTS)
    shutil.copy(tmp_path / "other" / CARD, folder / CARD)
    found = checked(folder)
    assert found.weights_fault is not None
    assert "has the SHA-256" in found.weights_fault
    assert found.card == "of other weights"


def test_weights_that_are_at_their_other_name_or_nowhere(folder: Path) -> None:
    (folder / WEIGHTS).rename(folder / NEXT_WEIGHTS)
    (folder / WEIGHTS).write_text("of an old run")
    assert (checked(folder).weights, checked(folder).weights_fault) == (NEXT_WEIGHTS, None)
    for name in (WEIGHTS, NEXT_WEIGHTS):
        (folder / name).unlink()
    assert (checked(folder).weights, checked(folder).weights_fault) == (WEIGHTS, "is missing")


def test_a_file_that_is_far_too_large_is_not_read(folder: Path) -> None:
    with (folder / WEIGHTS).open("r+b") as file:
        file.truncate(1 << 40)
    assert "1099511627776 bytes, expected at most" in str(checked(folder).weights_fault)


def test_a_record_that_does_not_name_its_weights(folder: Path) -> None:
    record = read_values(folder / RUN_RECORD)
    del record[WEIGHTS_SHA256]
    found = check_files(folder, record)
    assert (found.weights_fault, found.weights_named) == (None, False)


@pytest.mark.parametrize(("text", "state"), [(None, "missing"), ("# My notes", "not of handsight")])
def test_cards(folder: Path, text: str | None, state: str) -> None:
    (folder / CARD).unlink()
    if text is not None:
        (folder / CARD).write_text(text)
    assert checked(folder).card == state
