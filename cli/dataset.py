"""``handsight dataset``: create, look into and release datasets."""

from __future__ import annotations

from typing import Annotated, Any

import pandas as pd
import typer

from handsight.cli import dataset_checks, dataset_curation, dataset_exchange, dataset_versions
from handsight.cli.options import Dataset, DatasetPath, Json
from handsight.cli.output import console, print_json, print_table
from handsight.datasets import DatasetAddress, GraspDataset, GraspRepository

dataset_app = typer.Typer(help="Create, inspect and release grasp datasets.", no_args_is_help=True)


@dataset_app.command("init")
def init(dataset: DatasetPath) -> None:
    """Create an empty dataset; refuses a place where something is already."""
    GraspRepository.create(dataset)
    console.print(f"created an empty dataset at [bold]{dataset}[/]")


@dataset_app.command("info")
def info(dataset: Dataset, as_json: Json = False) -> None:
    """Summarise a version: size, balance, digest."""
    facts = GraspDataset.open(dataset).info()
    if as_json:
        print_json(facts)
        return
    labelled = facts.outcomes["held"] + facts.outcomes["empty"]
    share = f" ({facts.successes / labelled:.1%} of {labelled} labelled)" if labelled else ""
    rows = [
        ("version", f"{facts.ref} ({facts.snapshot})"),
        ("attempts", f"{facts.attempts} in {facts.sessions} session{'' if facts.sessions == 1 else 's'}"),
        ("successes", f"{facts.successes}{share}"),
        ("outcomes", ", ".join(f"{count} {name}" for name, count in facts.outcomes.items())),
        ("excluded", str(facts.excluded)),
        ("objects", f"{sum(count > 0 for count in facts.objects.values())} targeted of {len(facts.objects)}"),
        ("on disk", f"{facts.bytes / 1e6:.1f} MB"),
        ("schema", str(facts.schema_version)),
        ("digest", facts.digest),
    ]
    for name, value in rows:
        console.print(f"[bold]{name:<10}[/] {value}")


LS_COLUMNS = ("outcome", "target", "pregrasp_x_m", "pregrasp_y_m", "pregrasp_angle_rad", "width_final_m", "failure")


@dataset_app.command("ls")
def ls(
    dataset: Dataset,
    limit: Annotated[int, typer.Option("--limit", "-n", min=0, help="Rows to show; 0 shows all.")] = 20,
    as_json: Json = False,
) -> None:
    """List attempts, newest last."""
    opened = GraspDataset.open(dataset)
    total = sum(session.attempts for session in opened.sessions)
    shown = opened.tail(limit or total)
    if as_json:
        print_json([{"attempt": key, **_json_row(row)} for key, row in shown.iterrows()])
        return
    rows = [(str(key), *(_cell(row[name]) for name in LS_COLUMNS)) for key, row in shown.iterrows()]
    print_table(("attempt", "outcome", "target", "x [m]", "y [m]", "angle [rad]", "width [m]", "failure"), rows)
    if len(shown) < total:
        console.print(f"the last {len(shown)} of {total}; --limit 0 shows all")


@dataset_app.command("show")
def show(
    dataset: Dataset,
    attempt: Annotated[str, typer.Argument(help="Attempt id, as printed by ls.")],
    as_json: Json = False,
) -> None:
    """Print everything known of an attempt."""
    opened = GraspDataset.open(dataset)
    opened.attempt(attempt)  # checks the id, and every stored byte against its checksum
    facts = _json_row(opened.rows([attempt]).iloc[0])
    facts["station"] = opened.station(attempt)
    if as_json:
        print_json({"attempt": attempt, **facts})
        return
    console.print(f"[bold]{attempt}[/]")
    for name, value in facts.items():
        if name == "station":
            value = f"{value.source}, camera {value.camera.intrinsics.width}x{value.camera.intrinsics.height}"
        console.print(f"  {name:<22} {_cell(value)}")


@dataset_app.command("log")
def log(dataset: Dataset, as_json: Json = False) -> None:
    """List the commits of a version, newest first."""
    address = DatasetAddress.parse(dataset)
    entries = GraspRepository.open(address.path).log(address.ref)
    if as_json:
        print_json(entries)
        return
    rows = [
        (
            entry.snapshot_id,
            f"{entry.written_at:%Y-%m-%d %H:%M:%S}",
            f"{entry.attempts_added}",
            ", ".join(entry.refs),
            entry.message,
        )
        for entry in entries
    ]
    print_table(("snapshot", "written (UTC)", "added", "refs", "message"), rows)


@dataset_app.command("release")
def release(
    dataset: Dataset,
    name: Annotated[str, typer.Argument(help="Name of the release, such as v1; never to be used again.")],
    message: Annotated[str, typer.Option("--message", "-m", help="What it is for.")] = "",
) -> None:
    """Give a version an immutable name."""
    address = DatasetAddress.parse(dataset)
    made = GraspRepository.open(address.path).release(name, address.ref, message)
    console.print(f"released {address.path}@[bold]{made.name}[/] (snapshot {made.snapshot_id})")


for group in (dataset_curation, dataset_versions, dataset_checks, dataset_exchange):
    group.register(dataset_app)


def _json_row(row: pd.Series[Any]) -> dict[str, Any]:
    return {str(name): _json_cell(value) for name, value in row.items()}


def _json_cell(value: Any) -> Any:
    if isinstance(value, tuple):
        return list(value)
    return None if pd.isna(value) else value.isoformat() if isinstance(value, pd.Timestamp) else value


def _cell(value: Any) -> str:
    if isinstance(value, list | tuple):
        return ", ".join(map(str, value))
    if value is None or pd.isna(value):
        return "-"
    return f"{value:.4f}" if isinstance(value, float) else str(value)
