"""``handsight objects``: what the simulated station can drop."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from handsight.cli.options import Json
from handsight.cli.output import console, print_json, print_table, progress_bar
from handsight.collection.sim.objects import list_object_sets

objects_app = typer.Typer(help="Object sets of the simulated station.", no_args_is_help=True)


@objects_app.command("ls")
def ls(as_json: Json = False) -> None:
    """List the object sets on this machine."""
    sets = list_object_sets()
    if as_json:
        print_json(sets)
    else:
        rows = [(one.name, str(one.objects), one.licence, one.description) for one in sets]
        print_table(("set", "objects", "licence", "what"), rows)


@objects_app.command("import")
def import_meshes(
    folder: Annotated[Path, typer.Argument(help="Folder with obj, stl, ply or glb files.")],
    name: Annotated[str, typer.Option("--name", help="Name of the set from now on.")],
    scale: Annotated[float, typer.Option(help="Metres per unit of the files.")] = 1.0,
    pattern: Annotated[str, typer.Option(help="Which files below the folder are read.")] = "**/*",
    licence: Annotated[str, typer.Option(help="Terms under which the meshes are used.")] = "unknown",
    density: Annotated[float, typer.Option(help="Mass per enclosed volume [kg/m3].")] = 400.0,
    skip_bad: Annotated[bool, typer.Option("--skip-bad", help="Leave bad meshes out instead of refusing all.")] = False,
    as_json: Json = False,
) -> None:
    """Check meshes, cut them into convex parts, and keep them as an object set."""
    # Trimesh and CoACD are slow to import, and listing sets needs neither.
    from handsight.collection.sim.objects.meshes.importer import ImportSettings, import_folder

    settings = ImportSettings(scale=scale, density_kg_m3=density, licence=licence, pattern=pattern)
    with progress_bar("import", 0) as bar:
        report = import_folder(folder, name, settings=settings, skip_bad=skip_bad, progress=bar.of)
    if as_json:
        print_json(report)
        return
    for skipped in report.skipped:
        console.print(f"left out {skipped.path}: {skipped.reason}")
    what = "was imported before, nothing has changed" if report.reused else "is ready"
    console.print(f"object set [bold]{report.name}[/] with {len(report.objects)} objects {what} ({report.folder})")
