"""What help says: no unit is lost, every command shows how it is called, and what it shows works."""

from __future__ import annotations

import shlex

import pytest
from tests.support.command_tree import COMMANDS

from handsight.cli.app import run
from handsight.cli.options import DEFAULT_METHOD, DEFAULT_THRESHOLD, EVALUATION_SEED, NOVEL_OBJECTS, TRAINING_OBJECTS
from handsight.collection.sim.objects.catalogue import OBJECT_SETS
from handsight.datasets import EXPORT_FORMATS, FORMATS, VIEWPOINTS
from handsight.datasets.curation.folds import GROUPINGS
from handsight.evaluation.disturbance import EXAMPLES
from handsight.evaluation.evaluate import EvaluationSettings
from handsight.servoing.loop import ServoSettings
from handsight.servoing.methods.registry import METHODS


def page(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    """A help page in one line: it may be broken anywhere."""
    capsys.readouterr()
    assert run([*words, "--help"]) == 0
    return " ".join(capsys.readouterr().out.split())


def test_there_are_commands() -> None:
    assert {"demo", "collect sim", "dataset ls", "dataset suspect", "objects import"} <= set(COMMANDS)
    assert len(COMMANDS) >= 36


@pytest.mark.parametrize("name", COMMANDS)
def test_no_word_of_a_help_text_is_lost(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    words, _, command = COMMANDS[name]
    shown = page(capsys, *words)
    texts = [command.help, *(parameter.help for parameter in command.params if parameter.name != "help")]
    for text in texts:
        assert text, f"{name} has an option without help"
        assert " ".join(text.split()) in shown


def test_units_are_among_them(capsys: pytest.CaptureFixture[str]) -> None:
    assert "[px]" in page(capsys, "dataset", "materialize")
    assert "[kg/m3]" in page(capsys, "objects", "import")


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_shows_calls_of_itself(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    words, entry, _ = COMMANDS[name]
    assert 1 <= len(entry.examples) <= 3
    assert run([*words, "--help"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.strip() for line in lines[-len(entry.examples) :]] == list(entry.examples)
    for example in entry.examples:
        assert shlex.split(example)[: len(words) + 1] == ["handsight", *words]


@pytest.mark.parametrize("name", COMMANDS)
def test_every_call_that_is_shown_parses(name: str) -> None:
    # As they are parsed when typed; nothing is called, so that no dataset has to be there.
    words, entry, command = COMMANDS[name]
    for example in entry.examples:
        command.make_context(name, shlex.split(example)[len(words) + 1 :])


@pytest.mark.parametrize("name", COMMANDS)
def test_lines_of_the_list_are_whole(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    words, entry, _ = COMMANDS[name]
    assert entry.help.endswith(".")
    assert f"{entry.name} {entry.help}" in page(capsys, *words[:-1])  # a line too long would end in dots


def test_what_help_says_in_words_is_what_there_is(capsys: pytest.CaptureFixture[str]) -> None:
    """Names that stand in options as text, because the rooms they come from take a second to import."""
    assert f"One of {', '.join(EXPORT_FORMATS)}." in page(capsys, "dataset", "export")
    names = ", ".join(one.name for one in FORMATS)
    assert f"One of {names}, instead of looking." in page(capsys, "dataset", "import")
    for words in (("dataset", "materialize"), ("train",)):
        assert "|".join(VIEWPOINTS) in page(capsys, *words)
    assert "|".join(GROUPINGS) in page(capsys, "dataset", "folds")
    assert f"{', '.join(EXAMPLES[:-1])} or {EXAMPLES[-1]}." in page(capsys, "evaluate")


def test_defaults_of_options_are_those_of_the_rooms() -> None:
    assert ServoSettings().threshold == DEFAULT_THRESHOLD
    assert EvaluationSettings(methods=(DEFAULT_METHOD,), trials=1).seed == EVALUATION_SEED
    assert METHODS[DEFAULT_METHOD].settings is not None
    assert {TRAINING_OBJECTS, NOVEL_OBJECTS} <= set(OBJECT_SETS)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["datset"], "No such command 'datset'. Did you mean 'dataset'?"),
        (["dataset", "inof"], "No such command 'inof'. Did you mean 'info'?"),
        (["dataset", "ls", "x", "--wheer", "y"], "No such option: --wheer"),
        (["collect", "simm", "x"], "Did you mean 'sim'?"),
    ],
)
def test_a_typo_is_answered_with_what_was_meant(
    words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(words) == 2
    captured = capsys.readouterr()
    last = captured.err.splitlines()[-1]
    assert last.startswith("Error: ")
    assert said in last
    assert captured.out == ""


@pytest.mark.parametrize("words", [[], ["dataset"], ["collect"], ["objects"], ["runs"]])
def test_without_a_command_the_list_is_shown(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(words) == 2
    assert "Commands:" in capsys.readouterr().err
