"""Every command behind ``handsight``, as it is loaded when it is called."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from typer.main import get_command

from handsight.cli.app import app
from handsight.cli.lazy import LazyCommand, LazyGroup

Entry = tuple[tuple[str, ...], LazyCommand, Any]


def commands(group: Any, words: tuple[str, ...] = ()) -> Iterator[Entry]:
    """Every command below a group, with the words that call it and its line in the list."""
    for entry in group.table:
        command = entry.load()
        if isinstance(command, LazyGroup):
            yield from commands(command, (*words, entry.name))
        else:
            yield (*words, entry.name), entry, command


COMMANDS = {" ".join(words): (words, entry, command) for words, entry, command in commands(get_command(app))}
"""By the words that call them."""


def option_names(name: str) -> set[str]:
    """The options that a command takes."""
    return {option for parameter in COMMANDS[name][2].params for option in parameter.opts}
