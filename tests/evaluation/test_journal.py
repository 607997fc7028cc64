"""What a journal gives back, and what it refuses to go on with."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from tests.support.trials import make_trial

from handsight.evaluation.clearance import ClearedTable
from handsight.evaluation.errors import JournalError
from handsight.evaluation.journal import open_journal
from handsight.evaluation.journal_lines import TABLES
from handsight.evaluation.journal_lines import TRIALS as KIND
from handsight.evaluation.trial import Trial

SETTINGS: dict[str, Any] = {
    "weights_sha256": "ab" * 32,
    "seed": 3,
    "methods": {"cem-1": {"samples": 64}},
    "objects": {"o": {"shakes": 0}},
}
TRIALS = [
    make_trial(0, score=0.97, contact_height_m=0.1 + 0.2, contact_force_n=11.5, touched_by="palm", pushed_m=0.1),
    make_trial(1, "random", success=False, truth_held=None, failure="lift: é", aborted=False),
    make_trial(2, success=False, aborted=True, failure="look: lost"),
]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A journal of three trials."""
    path = tmp_path / "trials.jsonl"
    with open_journal(path, KIND, SETTINGS) as journal:
        assert journal.known("o") == []
        for trial in TRIALS:
            journal.append("o", trial)
    return path


def known(path: Path, objects: str = "o", settings: dict[str, Any] = SETTINGS) -> list[Trial]:
    with open_journal(path, KIND, settings) as journal:
        return journal.known(objects)


def test_trials_come_back_as_they_were(path: Path) -> None:
    assert known(path) == TRIALS
    assert known(path, "other") == []


def test_lines_from_before_it_was_told_what_landed_are_read(path: Path) -> None:
    known(path)
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    later = {"touched_by", "pushed_m", "steps"}
    before = [{name: value for name, value in line.items() if name not in later} for line in lines]
    path.write_text("".join(json.dumps(line) + "\n" for line in before))
    assert known(path) == [replace(trial, touched_by="", pushed_m=None, steps=()) for trial in TRIALS]


def test_what_is_not_a_number_comes_back_as_that(path: Path) -> None:
    with open_journal(path, KIND, SETTINGS) as journal:
        journal.append("other", replace(TRIALS[1], compute_s=math.nan))
    (trial,) = known(path, "other")
    assert math.isnan(trial.compute_s)
    assert trial.score is None
    json.loads(path.read_text().splitlines()[-1], parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))


@pytest.mark.parametrize("cut", [1, 10, 100])
def test_a_line_that_was_cut_off_is_done_again(path: Path, cut: int) -> None:
    path.write_bytes(path.read_bytes()[:-cut])
    with open_journal(path, KIND, SETTINGS) as journal:
        assert journal.known("o") == TRIALS[:2]
        journal.append("o", TRIALS[2])
    assert known(path) == TRIALS


@pytest.mark.parametrize("length", [0, 1, 12, 40])
def test_a_first_line_that_was_cut_off_begins_again(path: Path, length: int) -> None:
    path.write_bytes(path.read_bytes()[:length])
    assert known(path) == []
    assert json.loads(path.read_text())["settings"] == SETTINGS


def test_other_settings_and_weights_are_refused_all_at_once(path: Path) -> None:
    before = path.read_bytes()
    others = {
        "weights_sha256": "cd" * 32,
        "seed": 4,
        "methods": {"cem-1": {"samples": 65}},
        "objects": {"o": {"shakes": 0}, "p": {}},
    }
    with pytest.raises(JournalError) as caught:
        known(path, settings=others)
    for part in (
        "weights_sha256 is cdcdcdcdcdcd…, and was abababababab…",
        "seed is 4, and was 3",
        "methods cem-1 samples is 65, and was 64",
        "objects is o, p, and was o",
    ):
        assert part in str(caught.value)
    assert path.read_bytes() == before


def test_damaged_lines_are_all_named(path: Path) -> None:
    lines = path.read_text().splitlines(keepends=True)
    wrong = json.dumps({**json.loads(lines[2]), "moves": "many"}) + "\n"
    path.write_text("".join([lines[0], "[[[\n", wrong, lines[3], "{}\n"]))
    before = path.read_bytes()
    with pytest.raises(JournalError, match="damaged in line 2, 3, 5, expected a trial in each"):
        known(path)
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    "content", ["notes\n", "notes", "{}\n", "[1]\n", '{"handsight_evaluation": 1}\n', "\n", "\0\xff\n"]
)
def test_another_file_is_left_alone(tmp_path: Path, content: str) -> None:
    path = tmp_path / "notes"
    path.write_text(content)
    with pytest.raises(JournalError, match="no journal of an evaluation"):
        known(path)
    assert path.read_text() == content


def test_a_later_version_is_refused(path: Path) -> None:
    path.write_text(path.read_text().replace('"handsight_evaluation": 1', '"handsight_evaluation": 2'))
    with pytest.raises(JournalError, match="has version 2, expected 1"):
        known(path)


def test_two_cannot_write_one_journal(path: Path) -> None:
    with open_journal(path, KIND, SETTINGS), pytest.raises(JournalError, match="another evaluation is writing"):
        known(path)
    assert known(path) == TRIALS


TABLE = ClearedTable(
    number=4, method="cem-1", objects=5, cleared=3, attempts=6, successes=3, aborted=1, stopped="2 grasps in a row: é"
)


def test_tables_come_back_as_they_were_and_are_no_trials(path: Path, tmp_path: Path) -> None:
    tables = tmp_path / "tables.jsonl"
    with open_journal(tables, TABLES, SETTINGS) as journal:
        journal.append("o", TABLE)
        with pytest.raises(JournalError, match="another clearance is writing"), open_journal(tables, TABLES, SETTINGS):
            pass
    with open_journal(tables, TABLES, SETTINGS) as journal:
        assert journal.known("o") == [TABLE]
    with (
        pytest.raises(JournalError, match="no journal of a clearance"),
        open_journal(path, TABLES, SETTINGS),
    ):
        pass
    with pytest.raises(JournalError, match="no journal of an evaluation"):
        known(tables)
    with (
        pytest.raises(JournalError, match="holds tables of another clearance: seed is 4, and was 3"),
        open_journal(tables, TABLES, {**SETTINGS, "seed": 4}),
    ):
        pass


@pytest.mark.parametrize(
    "change", [{"objects": "five"}, {"objects": None}, {"stopped": 1}, {"aborted": True}, {"more": 1}, None]
)
def test_a_line_that_is_no_table_is_damage(tmp_path: Path, change: dict[str, Any] | None) -> None:
    path = tmp_path / "tables.jsonl"
    with open_journal(path, TABLES, SETTINGS) as journal:
        journal.append("o", TABLE)
    first, second = path.read_text().splitlines()
    line = json.loads(second)
    line["table"] = {**line["table"], **change} if change is not None else [4]
    path.write_text(f"{first}\n{json.dumps(line)}\n")
    with (
        pytest.raises(JournalError, match="damaged in line 2, expected a table in each"),
        open_journal(path, TABLES, SETTINGS),
    ):
        pass
