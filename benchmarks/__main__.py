"""``python -m benchmarks NAME [--json]``: run one benchmark, or all of them."""

from __future__ import annotations

import argparse
import ast
import importlib
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from benchmarks import Figure

FOLDER = Path(__file__).resolve().parent


def names() -> list[str]:
    """The benchmarks there are, sorted."""
    return sorted(path.stem for path in FOLDER.glob("*.py") if not path.stem.startswith("_"))


def summary(name: str) -> str:
    """First line of a benchmark's docstring, read without importing it."""
    docstring = ast.get_docstring(ast.parse((FOLDER / f"{name}.py").read_text())) or ""
    return docstring.partition("\n")[0]


def run(name: str) -> list[Figure]:
    """The figures of a benchmark, the headline first."""
    figures: list[Figure] = importlib.import_module(f"benchmarks.{name}").run()
    return figures


def report(name: str, figures: Sequence[Figure]) -> dict[str, Any]:
    """The JSON object of a benchmark: its headline, and all figures under ``figures``."""
    headline, *_ = figures
    return {**headline.as_json(), "benchmark": name, "figures": [figure.as_json() for figure in figures]}


def show(name: str, figures: Sequence[Figure], console: Console) -> None:
    """Print a table of figures."""
    table = Table(title=f"{name}: {summary(name)}", title_justify="left", box=None, pad_edge=False)
    for column in ("figure", "ours", "floor", "ratio", "unit", "n", "peers"):
        table.add_column(column, justify="right" if column in ("ours", "floor", "ratio", "n") else "left")
    for figure in figures:
        peers = ", ".join(f"{peer} {_number(value)}" for peer, value in figure.peers.items())
        numbers = (_number(value) for value in (figure.ours, figure.floor, figure.ratio))
        table.add_row(figure.name, *numbers, figure.unit, str(figure.n), peers)
    console.print(table)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what the command line asks for; exit status 0, or 2 for bad input."""
    described = "\n".join(f"  {name:<12} {summary(name)}" for name in names())
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks",
        description="Measure handsight against floors and peers, on this machine.",
        epilog=f"benchmarks:\n{described}" if described else None,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("name", choices=[*names(), "all"], metavar="NAME", help="a benchmark, or 'all'")
    parser.add_argument("--json", action="store_true", help="print one JSON value instead of tables")
    options = parser.parse_args(arguments)
    console = Console(highlight=False)
    reports = []
    for name in names() if options.name == "all" else [options.name]:
        figures = run(name)
        reports.append(report(name, figures))
        if not options.json:
            show(name, figures, console)
    if options.json:
        sys.stdout.write(json.dumps(reports if options.name == "all" else reports[0], indent=2) + "\n")
    return 0


def _number(value: float | None) -> str:
    if value is None:
        return "-"
    return f"{value:,.0f}" if abs(value) >= 100 else f"{value:.3g}"


def _leave_the_root() -> None:
    """Take the repository's root off the import path: its folder ``datasets`` shadows a well-known package."""
    sys.path[:] = [entry for entry in sys.path if Path(entry).resolve() != FOLDER.parent]


if __name__ == "__main__":
    _leave_the_root()
    sys.exit(main())
