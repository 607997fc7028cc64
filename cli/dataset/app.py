"""``handsight dataset``: create, look into and release datasets."""

from __future__ import annotations

from typing import Annotated

import typer

from handsight.cli.dataset import curation, exchange, inspect, integrity, suspect, versions
from handsight.cli.options import Dataset, DatasetPath, Json
from handsight.cli.output import console, print_json, print_table
from handsight.datasets.address import DatasetAddress
from handsight.datasets.errors import counted
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.store.repository import GraspRepository

dataset_app = typer.Typer(help="Create, inspect and release grasp datasets.", no_args_is_help=True)


@dataset_app.command("init")
def init(dataset: DatasetPath) -> None:
    """Create an empty dataset; refuses a location where something is already."""
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
        ("attempts", f"{facts.attempts} in {counted(facts.sessions, 'session')}"),
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


for group in (inspect, curation, versions, integrity, exchange, suspect):
    group.register(dataset_app)
