"""What might be typed: whole command lines with values that nobody expects, and what becomes of them."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
from tests.support.fuzz_mutations import ODD_VALUES, ODD_WORDS, mutate_text, one_of
from tests.support.fuzz_sources import command
from tests.support.typed_values import TYPED
from typer.main import get_command

from handsight.cli.app import app

WHERE = (
    "success == 1 and width_final_m > 0.01",
    "outcome in ('held', 'empty')",
    "not (number < 3 or target == 'cup')",
    "target.str.contains('c.p')",
)


def where_words(folder: Path, rng: np.random.Generator) -> list[str]:
    """An expression."""
    del folder
    if rng.random() < 0.4:
        return ["dataset", "ls", "{dataset}", f"--where={TYPED['where'](rng)}", "--json"]
    text = one_of(WHERE, rng)
    for _ in range(int(rng.integers(1, 4))):
        text = mutate_text(text, rng)
    return ["dataset", "ls", "{dataset}", f"--where={text}", "--json"]


def ref_words(_: Path, rng: np.random.Generator) -> list[str]:
    """A place, a version or an attempt's number."""
    verb = one_of(("info", "ls", "log", "stats"), rng)
    ref = one_of((*ODD_WORDS, mutate_text("main", rng), mutate_text("v1", rng)), rng)
    kind = int(rng.integers(6))
    if kind == 0:
        return ["dataset", verb, "{dataset}@" + ref]
    if kind == 3:
        return ["dataset", verb, TYPED["address"](rng)]
    if kind == 4:
        return ["dataset", "show", "{dataset}", TYPED["attempt"](rng)]
    if kind == 5:
        return ["dataset", one_of(("gc", "expire"), rng), "{dataset}", f"--older-than={TYPED['age'](rng)}", "--dry-run"]
    if kind == 1:
        return ["dataset", verb, mutate_text("s3://bucket/prefix@v1", rng) if rng.random() < 0.2 else ref + "/none"]
    return ["dataset", "show", "{dataset}", ref]


SLOW = (
    "view",
    "heatmap",
    "servo",
    "demo",
    "train",
    "evaluate",
    "collect",
    "review",
    "report",
    "crossval",
    "ablate",
    "tune",
)
"""What would work for long, or open a window: of these the words are parsed, and nothing is carried out."""


def commands() -> list[tuple[list[str], Any]]:
    """Every command with its words."""
    found: list[tuple[list[str], Any]] = []

    def walk(words: list[str], one: Any) -> None:
        if hasattr(one, "list_commands"):
            with one.make_context("handsight", [], resilient_parsing=True) as context:
                for name in one.list_commands(context):
                    walk([*words, name], one.get_command(context, name))
        else:
            found.append((words, one))

    walk([], get_command(app))
    return found


def option_words(_: Path, rng: np.random.Generator) -> list[str]:
    """Some option of some command with a value that it may not expect."""
    words, one = one_of(commands(), rng)
    options = [item for item in one.params if item.param_type_name == "option" and not item.is_flag]
    chosen = [one_of(options, rng) for _ in range(int(rng.integers(1, 3))) if options]
    values = (*ODD_WORDS, *(str(value) for value in ODD_VALUES if isinstance(value, int | float | str)))
    given = [f"{option.opts[0]}={one_of(values, rng)}" for option in chosen]
    dataset = "{nothing}" if words[0] in SLOW or words[:1] == ["objects"] else "{dataset}"
    arguments = [item for item in one.params if item.param_type_name == "argument"]
    filled = [one_of((dataset, *ODD_WORDS), rng) if place else dataset for place, _ in enumerate(arguments)]
    return [*words, *given, "--", *filled] if filled else [*words, *given]


def parse_words(folder: Path, words: list[str]) -> int:
    """The command line, in the dataset's folder."""
    places = {"{dataset}": str(folder / "grasps"), "{nothing}": str(folder / "none")}
    filled = []
    for word in words:
        for name, place in places.items():
            word = word.replace(name, place)
        filled.append(word)
    if words[0] in SLOW:
        (one,) = (one for name, one in commands() if name == words[: len(name)])
        try:
            one.make_context(words[0], filled[1 + (words[0] == "collect") :])
        except (SystemExit, Exception) as error:
            if "click" not in type(error).__module__:
                raise
            return 2
        return 0
    return command(*filled)


VARIABLES = ("COLUMNS", "LINES", "TERM", "HOME", "USER", "LANG", "TZ", "NO_COLOR", "FORCE_COLOR", "HANDSIGHT_AUTHOR")


def environment_words(_: Path, rng: np.random.Generator) -> list[str]:
    """A variable of the environment with an odd value, and a command."""
    value = one_of([word for word in ODD_WORDS if "\0" not in word], rng)
    verb = one_of((["ls"], ["info"], ["stats"], ["log"], ["exclude", "0", "--reason=dark"]), rng)
    return [f"{one_of(VARIABLES, rng)}={value}", "dataset", verb[0], "{dataset}", *verb[1:]]


def parse_in_environment(folder: Path, words: list[str]) -> int:
    """The command line with one variable changed for it alone."""
    name, _, value = words[0].partition("=")
    before = os.environ.get(name)
    os.environ[name] = value
    try:
        return parse_words(folder, words[1:])
    finally:
        os.environ.pop(name)
        if before is not None:
            os.environ[name] = before
