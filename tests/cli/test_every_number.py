"""Whatever is typed where a command takes a number, or an age, is answered in one line and at once."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import pytest
from tests.support.command_tree import COMMANDS
from tests.support.meshes import block, stl
from tests.support.versions import grow

from handsight.cli.app import run
from handsight.datasets import GraspRepository

HUGE = str(10**30)
VALUES = (
    "nan",
    "inf",
    "-inf",
    "1e308",
    "-1",
    "0",
    "1",
    "0.5",
    HUGE,
    "9" * 5000,
    "",
    " ",
    "ten",
    "0x10",
    "1,5",
    "\N{DIGIT ONE}\N{ARABIC-INDIC DIGIT ONE}",
)
LARGEST = "1e308", "-1e308", HUGE, f"-{HUGE}"

NOTHING = {
    "clearance": "--model {nowhere}",
    "collect picture": "--out {nowhere}/x.png",
    "collect sim": "/proc/grasps",
    "collect ur10": "/proc/grasps --rig {nowhere}",
    "dataset expire": "{nowhere} --older-than 1d",
    "dataset similar": "{nowhere} 1 --model {nowhere}",
    "demo": "--out {file}",
    "evaluate": "--model {nowhere}",
    "heatmap": "{nowhere} --model {nowhere}",
    "objects import": "{nowhere} --name kitchen",
    "prediction": "--model {nowhere}",
    "rig emulate": "--rig {nowhere}",
    "servo": "--model {nowhere}",
    "train": "{nowhere} --out {nowhere}",
    "tune": "{nowhere} --out {nowhere}",
}
"""What else has to be said, so that a sound number is refused as well; ``{nowhere}`` for any other command."""

AGES = {"dataset gc": "--older-than", "dataset expire": "--older-than"}


def numbers() -> Iterator[tuple[str, str]]:
    """Every option and argument that is a number or an age, by the command it belongs to."""
    for name, (_, _, command) in COMMANDS.items():
        for parameter in command.params:
            annotation: Any = getattr(getattr(parameter, "type_descriptor", None), "annotation", None)
            if {int, float} & {annotation, *get_args(annotation)}:
                yield name, parameter.opts[0]
        if name in AGES:
            yield name, AGES[name]


NUMBERS = list(numbers())

SENSELESS = {
    "dataset ls {data} --limit": ("-1", *LARGEST),
    "dataset folds {data} two --by scene --count": ("-1", "0", "1", "101", *LARGEST),
    "dataset folds {data} two --by scene --seed": ("-1", *LARGEST),
    "dataset undo {data} --": ("-1", "0", "99", *LARGEST),
    "dataset show {data} --": ("-1", "-0", "6", "0.5", *LARGEST),
    "dataset exclude {data} -m x --": ("-1", "6", "1e0", *LARGEST),
    "dataset materialize {data} --size": ("-1", "0", "1", "401", "100000", *LARGEST),
    "dataset verify {data} --jobs": ("-1", "1025", *LARGEST),
    "dataset doctor {data} --resimulate": ("-1", *LARGEST),
    "dataset doctor {data} --resimulate 1 --seed": ("-1", *LARGEST),
    "dataset suspect {data} --epochs": ("-1", "0", *LARGEST),
    "dataset suspect {data} --epochs 1 --count": ("-1", "0", *LARGEST),
    "dataset suspect {data} --epochs 1 --seed": ("-1", *LARGEST),
    "dataset gc {data} --older-than": (
        "99999999999999w",
        "-1d",
        "1e3s",
        "1.5h",
        "9" * 5000 + "s",
        "9999-01-01",
        "0001-01-01",
    ),
    "dataset expire {data} --older-than": (
        "999999999d",
        "-1d",
        "\N{ARABIC-INDIC DIGIT ONE}d",
        "9" * 5000 + "w",
        "9999-01-01",
    ),
    "objects import {meshes} --name kitchen --scale": ("nan", "inf", "-inf", "-1", "0", "1e-300", "1e5", *LARGEST),
    "objects import {meshes} --name kitchen --density": ("nan", "inf", "-inf", "-1", "0", *LARGEST),
    "train {data} --out {nowhere} --epochs": ("-1", "0", *LARGEST),
    "train {data} --out {nowhere} --batch": ("-1", "0", "1", *LARGEST),
    "tune {data} --out {nowhere} --proposals": ("-1", "0", "10001", *LARGEST),
    "tune {data} --out {nowhere} --trials": ("-1", "0", "1001", *LARGEST),
    "tune {data} --out {nowhere} --size": ("-1", "0", "1", "20,30", *LARGEST),
    "tune {data} --out {nowhere} --held-out": ("-1", "0", "1", "nan", *LARGEST),
    "collect sim {nowhere} --attempts": ("-1", "0", *LARGEST),
    "collect sim {nowhere} --workers": ("-1", "0", "1025", *LARGEST),
    "collect sim {nowhere} --objects-per-scene": ("-1", "0", "999", *LARGEST),
    "collect sim {nowhere} --shakes": ("-1", "101", *LARGEST),
    "collect sim {nowhere} --random-share": ("0.5", "nan", *LARGEST),
    "demo --out {nowhere} --trials": ("-1", "0", *LARGEST),
    "demo --out {nowhere} --workers": ("-1", "0", *LARGEST),
}
"""Numbers that nothing can be done with, where everything else is sound."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("numbers")
    grow(GraspRepository.create(folder / "data"), to=6)
    (folder / "meshes").mkdir()
    (folder / "meshes" / "box.stl").write_bytes(stl(block()))
    (folder / "file").write_text("in the way")
    return folder


def check_refused(capsys: pytest.CaptureFixture[str], call: str, value: str, folder: Path) -> None:
    names = {name: folder / name for name in ("data", "meshes", "file", "nowhere")}
    *words, last = (word.format(**names) for word in call.split())
    # With the sign of equality, because a value below zero looks like an option.
    answer = run([*words, last, value] if last == "--" else [*words, f"{last}={value}"])
    captured = capsys.readouterr()
    assert answer == 2, value
    assert any(line.startswith(("error: ", "Error: ")) for line in captured.err.splitlines()), value
    assert "Traceback" not in captured.err
    assert captured.out == ""
    assert not (folder / "nowhere").exists()


def test_there_are_numbers() -> None:
    assert {("collect sim", "--threshold"), ("dataset undo", "number"), ("dataset gc", "--older-than")} <= set(NUMBERS)
    assert len(NUMBERS) >= 37


@pytest.mark.parametrize(("name", "option"), NUMBERS)
def test_no_text_breaks_a_number(name: str, option: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    call = f"{name} {NOTHING.get(name, '{nowhere}')} {option if option.startswith('-') else '--'}"
    for value in VALUES:
        check_refused(capsys, call, value, folder)


@pytest.mark.parametrize("call", SENSELESS)
def test_a_number_without_sense_is_refused(
    call: str, folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HANDSIGHT_CACHE", str(folder / "cache"))
    for value in SENSELESS[call]:
        check_refused(capsys, call, value, folder)
