"""``handsight objects``: what the simulated station can drop."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from handsight.cli.lazy import LazyCommand, LazyGroup, lazy_app
from handsight.cli.options import DryRun, Json
from handsight.cli.output import bold, console, errors, print_json, progress_bar
from handsight.cli.tables import Column, print_table
from handsight.collection.errors import MeshImportError
from handsight.datasets.errors import counted

if TYPE_CHECKING:
    # Trimesh and CoACD are slow to import, and listing sets needs neither.
    from handsight.collection.sim.objects.meshes.importer import ImportReport
    from handsight.collection.sim.objects.meshes.plan import ImportPlan, SkippedMesh


class ObjectsGroup(LazyGroup):
    """Everything behind ``handsight objects``."""

    table = (
        LazyCommand("ls", "objects:ls", "List the object sets on this machine.", ("handsight objects ls",)),
        LazyCommand(
            "import",
            "objects:import_meshes",
            "Make an object set of a folder of meshes.",
            (
                "handsight objects import meshes --name kitchen --dry-run",
                "handsight objects import meshes --name kitchen --scale 0.001 --skip-bad",
            ),
        ),
    )


objects_app = lazy_app(ObjectsGroup, help="Object sets of the simulated station.")


def ls(as_json: Json = False) -> None:
    """List the object sets on this machine."""
    from handsight.collection.sim.objects.catalogue import list_object_sets  # OpenCV and NumPy, once it is called

    sets = list_object_sets()
    if as_json:
        print_json(sets)
    else:
        rows = [(one.name, str(one.objects), one.licence, one.description) for one in sets]
        print_table(("set", "objects", Column(heading="licence", rank=1), Column(heading="what", prose="wrap")), rows)


def import_meshes(
    folder: Annotated[Path, typer.Argument(help="Folder with obj, stl, ply or glb files.")],
    name: Annotated[str, typer.Option("--name", help="Name of the set from now on.")],
    scale: Annotated[float, typer.Option(max=1e6, help="Metres per unit of the files.")] = 1.0,
    pattern: Annotated[str, typer.Option(help="Which files below the folder are read.")] = "**/*",
    licence: Annotated[str, typer.Option(help="Terms under which the meshes are used.")] = "unknown",
    density: Annotated[float, typer.Option(max=1e6, help="Mass per enclosed volume [kg/m3].")] = 400.0,
    plain: Annotated[bool, typer.Option("--plain", help="Leave materials, textures and colours unread.")] = False,
    skip_bad: Annotated[bool, typer.Option("--skip-bad", help="Leave bad meshes out instead of refusing all.")] = False,
    dry_run: DryRun = False,
    as_json: Json = False,
) -> None:
    """Check meshes, cut them into convex parts, and keep them as an object set."""
    from handsight.collection.sim.objects.meshes.importer import carry_out
    from handsight.collection.sim.objects.meshes.plan import ImportSettings, plan_import

    settings = ImportSettings(scale=scale, density_kg_m3=density, licence=licence, pattern=pattern, plain=plain)
    with _exit_codes():
        with progress_bar("check", 0) as bar:
            plan = plan_import(folder, name, settings=settings, skip_bad=skip_bad, progress=bar.of)
        if dry_run:
            _show_plan(plan, as_json=as_json)
            return
        with progress_bar("import", 0) as bar:
            report = carry_out(plan, progress=bar.of)
    _show_report(report, as_json=as_json)


@contextmanager
def _exit_codes() -> Iterator[None]:
    """A refusal keeps its lines, one for each bad mesh; Ctrl-C says what is left behind."""
    try:
        yield
    except MeshImportError as error:
        sys.stderr.write(f"error: {error}\n")
        raise typer.Exit(2) from None
    except KeyboardInterrupt:
        errors.print("interrupted: nothing was imported")
        raise typer.Exit(130) from None


def _show_plan(plan: ImportPlan, *, as_json: bool) -> None:
    from handsight.collection.sim.objects.meshes.fault import shown

    if as_json:
        print_json(plan)
        return
    _show_skipped(plan.source, plan.skipped)
    rows = [
        (
            item.name,
            " x ".join(f"{extent_m * 1000:.0f}" for extent_m in item.size_m),
            f"{item.mass_kg * 1000:.0f}",
            str(item.triangles),
            "texture" if item.textured else "colour",
            shown(item.source),
        )
        for item in plan.objects
    ]
    columns = (
        "object",
        Column(heading="size [mm]", rank=1),
        Column(heading="mass [g]", rank=2),
        Column(heading="triangles", rank=3),
        Column(heading="looks", rank=5),
        Column(heading="file", rank=4),
    )
    print_table(columns, rows)
    what = "was imported before, nothing would change" if plan.reused else "would be made"
    _show_set(plan, what)


def _show_report(report: ImportReport, *, as_json: bool) -> None:
    if as_json:
        print_json(report)
        return
    _show_skipped(report.source, report.skipped)
    _show_set(report, "was imported before, nothing has changed" if report.reused else "is ready")


def _show_set(made: ImportPlan | ImportReport, what: str) -> None:
    console.print(
        "object set ", bold(made.name), f" with {counted(len(made.objects), 'object')} {what} ({made.folder})"
    )


def _show_skipped(folder: Path, skipped: Sequence[SkippedMesh]) -> None:
    for item in skipped:
        console.print(f"left out {item.line(folder)}")
