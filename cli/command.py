"""What every command does beside its own work: it finds the home folder, and ends quietly after Ctrl-C."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import typer
from typer.core import TyperCommand

from handsight.cli.interrupts import INTERRUPTED


class HandsightCommand(TyperCommand):
    """A command of the table of a group."""

    kept = ""
    """What is said after Ctrl-C: what of the work is kept, and how to go on."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the words; a path that begins with ``~`` lies in the home folder, if the shell has not said so yet."""
        rest = super().parse_args(ctx, args)
        for parameter in self.params:
            value = ctx.params.get(parameter.name)
            if isinstance(value, Path) and value.parts[:1] and value.parts[0].startswith("~"):
                ctx.params[parameter.name] = _expanded(value)
        return rest

    def invoke(self, ctx: Any) -> Any:
        """Call the command."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            sys.stderr.write(f"interrupted: {self.kept}\n" if self.kept else "interrupted\n")
            raise typer.Exit(INTERRUPTED) from None


def _expanded(path: Path) -> Path:
    try:
        return path.expanduser()
    except RuntimeError as error:
        from handsight.cli.errors import CommandError  # imports every room, which only a refusal should pay for

        raise CommandError(f"{path} begins with {path.parts[0]}, and there is no such home folder") from error
