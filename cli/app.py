"""Assembles the ``handsight`` command and turns expected errors into one line and exit status 2.

Only the noun that was typed is imported: PyTorch and Rerun take seconds, and neither ``--help`` nor ``dataset ls``
needs them. The other nouns are listed with their help alone.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import typer

from handsight import __version__


@dataclass(frozen=True, slots=True)
class Noun:
    """One word behind ``handsight``."""

    name: str
    target: str
    """Module and attribute: a function for one command, a Typer app for several."""
    help: str

    def load(self) -> Any:
        """Import the command or app."""
        module, attribute = self.target.split(":")
        return getattr(import_module(f"handsight.cli.{module}"), attribute)


NOUNS = (
    Noun("demo", "demo:demo", "The whole line in one command: collect, train, servo, show."),
    Noun("collect", "collect:collect_app", "Collect grasp attempts into a dataset."),
    Noun("dataset", "dataset.app:dataset_app", "Create, inspect and release grasp datasets."),
    Noun("train", "train:train_command", "Train a network on a version of a dataset."),
    Noun("evaluate", "evaluate:evaluate_command", "Compare servo methods on the same trials."),
    Noun("heatmap", "heatmap:heatmap_command", "Record heatmaps of predicted success."),
    Noun("servo", "servo:servo_command", "Servo once, grasp, and record every step."),
    Noun("objects", "objects:objects_app", "Object sets of the simulated station."),
)


def _unused() -> None:
    """Stands for a command that was not typed."""


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(__version__)
        raise typer.Exit


def _root(
    version: bool = typer.Option(
        False, "--version", callback=_print_version, is_eager=True, help="Print the version and exit."
    ),
) -> None:
    """A data engine for learning planar grasps from a camera on the gripper."""


def build_app(typed: str | None) -> typer.Typer:
    """The command line in which the noun ``typed`` is real and the others are listed."""
    app = typer.Typer(
        name="handsight",
        no_args_is_help=True,
        add_completion=False,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.callback()(_root)
    for noun in NOUNS:
        target = noun.load() if noun.name == typed else _unused
        if isinstance(target, typer.Typer):
            app.add_typer(target, name=noun.name, help=noun.help)
        else:
            # The command's own docstring says more than the line in the list.
            app.command(noun.name, help=None if noun.name == typed else noun.help)(target)
    return app


def run(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status: 0 done, 1 a check found something, 2 bad input."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    typed = next((word for word in words if not word.startswith("-")), None)
    try:
        build_app(typed)(args=words, prog_name="handsight")
    except SystemExit as leaving:
        return leaving.code if isinstance(leaving.code, int) else int(leaving.code is not None)
    except Exception as error:
        from handsight.cli.errors import EXPECTED, report  # imports every room, which only a failure should pay for

        if not isinstance(error, EXPECTED):
            raise
        report(error)
        return 2
    return 0


def main() -> None:
    """Entry point of the executable."""
    sys.exit(run())
