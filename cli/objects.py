"""``handsight objects``: what the simulated station can drop."""

from __future__ import annotations

import typer

from handsight.cli.options import Json
from handsight.cli.output import print_json, print_table
from handsight.collection.sim.objects import OBJECT_SETS, load_object_set

objects_app = typer.Typer(help="Object sets of the simulated station.", no_args_is_help=True)


@objects_app.command("ls")
def ls(as_json: Json = False) -> None:
    """List the object sets."""
    sets = [{"name": name, "objects": len(load_object_set(name))} for name in sorted(OBJECT_SETS)]
    if as_json:
        print_json(sets)
    else:
        print_table(("set", "objects"), [(str(one["name"]), str(one["objects"])) for one in sets])
