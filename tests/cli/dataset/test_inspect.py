"""``handsight dataset ls|show|stats`` as their user meets them: rows, counts, pictures, and one line for a mistake."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from tests.support.factories import make_attempt, make_header, record
from tests.support.lab import make_lab
from tests.support.refusals import check_refused

from handsight.cli.app import run
from handsight.datasets import Curator, GraspDataset, GraspRepository, Outcome, Selection
from handsight.datasets.curation.saved_filters import save_filter

OUTCOMES = (Outcome.HELD, Outcome.EMPTY, Outcome.ABORTED, Outcome.EMPTY, Outcome.EMPTY)


@pytest.fixture(scope="module")
def grasps(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """30 attempts, the first of every five held, one excluded; number 2 took no picture."""
    repository = GraspRepository.create(tmp_path_factory.mktemp("listing") / "grasps")
    header = make_header(width=16, height=12)
    attempts = [make_attempt(header, number, outcome=OUTCOMES[number % 5]) for number in range(30)]
    attempts[2] = replace(attempts[2], overhead=None, pregrasp=None)
    record(repository, header, attempts, every=30)
    Curator(repository, author="jo").exclude(Selection(where="number == 5"), "dark")
    save_filter(repository, "held", "success", author="jo")
    return Path(str(repository.path))


@pytest.fixture(scope="module")
def table(grasps: Path) -> pd.DataFrame:
    return GraspDataset.open(str(grasps)).attempts


def out_of(capsys: pytest.CaptureFixture[str], *words: object) -> str:
    capsys.readouterr()
    assert run([str(word) for word in words]) == 0
    return capsys.readouterr().out


def json_of(capsys: pytest.CaptureFixture[str], *words: object) -> Any:
    return json.loads(out_of(capsys, *words, "--json"))


def test_json_has_the_chosen_rows_and_all_columns(
    grasps: Path, table: pd.DataFrame, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = json_of(capsys, "dataset", "ls", grasps, "--filter", "held", "--where", "number > 4", "-n", 3)
    assert [row["number"] for row in rows] == [15, 20, 25]
    assert list(rows[0]) == ["attempt", *table.columns]
    everything = json_of(capsys, "dataset", "ls", grasps, "--limit", 0)
    assert [row["attempt"] for row in everything] == table.index.tolist()
    assert everything[5]["excluded"] is True


def test_columns_keep_their_kind(grasps: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ("dataset", "ls", grasps, "--columns", "number, success,width_final_m,seed", "-n", 3)
    rows = json_of(capsys, *words)
    assert [list(row) for row in rows] == [["attempt", "number", "success", "width_final_m", "seed"]] * 3
    assert [(row["number"], row["success"], row["seed"]) for row in rows] == [
        (27, None, 1),
        (28, False, 1),
        (29, False, 1),
    ]
    assert rows[0]["width_final_m"] is None
    (numbers,) = json_of(capsys, "dataset", "ls", grasps, "--columns", "number,width_before_m", "-n", 1)
    assert [type(value) for value in numbers.values()] == [str, int, float]
    header, first, *_ = out_of(
        capsys, "dataset", "ls", grasps, "--columns", "number,table_friction", "-n", 1
    ).splitlines()
    assert header.split() == ["attempt", "number", "table_friction"]
    assert first.split()[1] == "29"


def test_sorting_shows_what_is_sorted_by(
    grasps: Path, table: pd.DataFrame, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    words = ("dataset", "ls", grasps, "--sort", "contact_force_n", "--reverse", "-n", 2)
    expected = table.sort_values("contact_force_n", ascending=False).index[:2].tolist()
    assert [row["attempt"] for row in json_of(capsys, *words)] == expected
    monkeypatch.setenv("COLUMNS", "160")
    header, first, _, counts = out_of(capsys, *words).splitlines()
    assert header.split()[-1] == "contact_force_n"
    assert first.split()[0] == expected[0]
    assert counts == "the first 2 of 30 by contact_force_n, largest first; --limit 0 shows all"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["-n", "4"], "the last 4 of 30; --limit 0 shows all"),
        (["--where", "success"], "6 of 30 attempts match, all shown"),
        (["--where", "success", "-n", "2"], "6 of 30 attempts match; shown are the last 2; --limit 0 shows all"),
        (["--filter", "held", "--where", "excluded"], "1 of 30 attempts match, all shown"),
        (["--where", "number > 99"], "0 of 30 attempts match"),
        (
            ["--where", "success", "--sort", "number", "-n", "1"],
            "6 of 30 attempts match; shown are the first 1 by number, smallest first; --limit 0 shows all",
        ),
    ],
)
def test_it_says_how_many_match_and_are_shown(
    grasps: Path, words: list[str], said: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "120")
    assert out_of(capsys, "dataset", "ls", grasps, *words).splitlines()[-1] == said


def test_ids_alone_can_be_passed_on(grasps: Path, table: pd.DataFrame, capsys: pytest.CaptureFixture[str]) -> None:
    held = table.index[table["success"].fillna(False)].tolist()
    words = ("dataset", "ls", grasps, "--where", "success", "--ids")
    assert out_of(capsys, *words).split() == held
    assert json_of(capsys, *words) == held
    assert run([str(word) for word in (*words, "-n", 2)]) == 0
    printed = capsys.readouterr()
    assert printed.out.split() == held[-2:]
    assert "6 of 30 attempts match; shown are the last 2" in printed.err
    assert out_of(capsys, "dataset", "ls", grasps, "--where", "number > 99", "--ids").split() == []


def test_the_picture_of_an_attempt(grasps: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (row,) = json_of(capsys, "dataset", "ls", grasps, "--where", "number == 0")
    picture = tmp_path / "attempt.png"
    shown = json_of(capsys, "dataset", "show", grasps, row["attempt"], "--picture", picture)
    assert {name: shown[name] for name in row} == row
    assert picture.read_bytes()[:4] == b"\x89PNG"
    assert str(picture) in out_of(capsys, "dataset", "show", grasps, row["attempt"], "--picture", picture)


def test_the_figure_of_a_dataset(grasps: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plain = json_of(capsys, "dataset", "stats", grasps)
    figure = tmp_path / "stats.svg"
    assert json_of(capsys, "dataset", "stats", grasps, "--plot", figure) == plain
    assert (plain["labelled"], plain["successes"]) == (23, 5)
    assert {"objects", "sessions", "angle_rad", "width_m", "force_n"} <= set(plain)
    assert sum(plain["width_bins_m"]["attempts"]) == sum(window["attempts"] for window in plain["windows"]) == 23
    assert ">grasps@main: 5 of 23 labelled attempts succeed, 21.7 %<" in figure.read_text()
    assert [path.name for path in tmp_path.iterdir()] == ["stats.svg"]
    assert str(figure) in out_of(capsys, "dataset", "stats", grasps, "--plot", figure)


def mistakes(grasps: Path, table: pd.DataFrame, folder: Path) -> dict[str, tuple[list[str], str]]:
    """What is typed, and what the one line has to say."""
    listing, path, dark = ["dataset", "ls", str(grasps)], str(grasps), str(table.index[2])
    return {
        "column": ([*listing, "--columns", "number,sucess"], "no column 'sucess', did you mean success"),
        "sort": ([*listing, "--sort", "contact_force"], "no column 'contact_force', did you mean contact_force_n"),
        "filter": ([*listing, "--filter", "helt"], "no saved filter 'helt', did you mean held"),
        "where": ([*listing, "--where", "widht_final_m < 1"], "did you mean width_final_m"),
        "no truth": ([*listing, "--where", "number"], "yields int64, expected true or false"),
        "limit": ([*listing, "-n", "-3"], "limit is -3"),
        "all at once": ([*listing, "-n", "-3", "--sort", "numbr", "--where", "succes"], "did you mean number"),
        "ids and columns": ([*listing, "--ids", "--columns", "number"], "leave one of the two out"),
        "figure": (["dataset", "stats", path, "--plot", str(folder / "s.jpg")], "ends in .png or .svg"),
        "folder": (["dataset", "stats", path, "--plot", str(folder / "no" / "s.png")], "create it first"),
        "picture": (["dataset", "show", path, dark, "--picture", str(folder / "a.gif")], "ends in .png"),
        "no picture": (["dataset", "show", path, dark, "--picture", str(folder / "a.png")], "before it took a picture"),
    }


@pytest.mark.parametrize("name", mistakes(Path(), pd.DataFrame(index=list("abc")), Path()))
def test_mistakes_get_one_line_and_status_2(
    grasps: Path, table: pd.DataFrame, tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    words, said = mistakes(grasps, table, tmp_path)[name]
    check_refused(capsys, words, said)
    assert list(tmp_path.iterdir()) == []


def test_a_dataset_without_labels_has_no_figure(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    GraspRepository.create(tmp_path / "grasps")
    assert run(["dataset", "stats", str(tmp_path / "grasps"), "--plot", str(tmp_path / "s.png")]) == 2
    assert "grasps@main has no labelled attempt" in capsys.readouterr().err
    assert not (tmp_path / "s.png").exists()
    assert "0 of 0 labelled" in out_of(capsys, "dataset", "stats", tmp_path / "grasps")


def test_conditions_that_were_not_varied_are_counted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ids = [str(key) for key in GraspDataset(make_lab(tmp_path / "lab"), ref="main").attempts.index]
    varied, still = (out_of(capsys, "dataset", "show", tmp_path / "lab", one) for one in (ids[0], ids[-1]))
    assert "table_friction" in varied
    assert "not varied" not in varied
    assert "table_friction" not in still
    assert still.splitlines()[-1] == "  2 conditions not varied in its session; --all shows them"
    assert "table_friction" in out_of(capsys, "dataset", "show", tmp_path / "lab", ids[-1], "--all")
    assert "table_friction" in json_of(capsys, "dataset", "show", tmp_path / "lab", ids[-1])
