"""Groups that import a command when it is called and not when it is listed.

PyTorch, Icechunk and Rerun take seconds, and neither ``--help`` nor ``dataset ls`` needs all of them. So a group is a
table: each command with the line that lists it, examples, and where it is. Shell completion and suggestions for a
mistyped word come from the table too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from typing import Any, ClassVar

import typer
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command

from handsight.cli.command import HandsightCommand

_PLAIN: dict[str, Any] = {"rich_markup_mode": None, "pretty_exceptions_enable": False, "add_completion": False}
"""Help is plain text: Rich would take ``[px]`` for markup, and its import takes longer than everything else."""


@dataclass(frozen=True, slots=True)
class LazyCommand:
    """One word behind ``handsight``, or behind one of its groups."""

    name: str
    target: str
    """Module below ``handsight.cli`` and attribute: a function for one command, an app for a group of them."""
    help: str
    """The line that lists it. Its own page, made of the function's docstring, says more."""
    examples: tuple[str, ...] = ()
    """Calls that the page ends with; none for a group."""
    kept: str = ""
    """What Ctrl-C leaves, and how to go on; empty where nothing is lost but the answer."""

    def listed(self) -> TyperCommand:
        """What stands for it in a list: the name and the line."""
        return TyperCommand(self.name, help=self.help, rich_markup_mode=None)

    def load(self) -> Any:
        """Import it, as the command that parses its options or the group that looks further."""
        module, attribute = self.target.split(":")
        found = getattr(import_module(f"handsight.cli.{module}"), attribute)
        return _built(self, found)


@cache
def _built(entry: LazyCommand, found: Any) -> Any:
    """The command of an app or a function, which takes milliseconds to make of its signature and is then kept."""
    if isinstance(found, typer.Typer):
        return get_command(found)
    app = typer.Typer(**_PLAIN)
    app.command(entry.name, cls=HandsightCommand, epilog=_examples(entry.examples))(found)
    command = get_command(app)
    command.kept = entry.kept  # type: ignore[attr-defined]  # It is a HandsightCommand.
    return command


class LazyGroup(TyperGroup):
    """A group over a table."""

    table: ClassVar[tuple[LazyCommand, ...]] = ()

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        for command in self.table:
            self.add_command(command.listed())

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The command that is called, imported; help and completion of the group itself are content with the list."""
        name, listed, rest = super().resolve_command(ctx, args)
        return name, next((one.load() for one in self.table if one.name == name), listed), rest


def lazy_app(group: type[LazyGroup], **settings: Any) -> typer.Typer:
    """A Typer app over a table; it prints its help when no command is named.

    Args:
        group: The group with its table.
        settings: Of the app, as for ``typer.Typer``.
    """
    return typer.Typer(**{**_PLAIN, "cls": group, "no_args_is_help": True, "callback": _no_options, **settings})


def _no_options() -> None:
    """What a group does before its command: nothing."""


def _examples(calls: Sequence[str]) -> str:
    # Typer fills paragraphs unless their first line is a backspace.
    return "\n".join(("\b", "Examples:", *(f"  {call}" for call in calls)))
