"""Makes an object set of a folder of meshes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from handsight.collection.errors import MeshImportError
from handsight.collection.sim.objects.cache import publish
from handsight.collection.sim.objects.manifest import Manifest, ObjectEntry, folder_digest, read_manifest
from handsight.collection.sim.objects.meshes.appearance import appearance
from handsight.collection.sim.objects.meshes.decomposition import Cutter
from handsight.collection.sim.objects.meshes.fault import MeshFault
from handsight.collection.sim.objects.meshes.mesh_file import check_mesh
from handsight.collection.sim.objects.meshes.plan import (
    ImportPlan,
    ImportSettings,
    PlannedObject,
    Progress,
    SkippedMesh,
    check_same,
    plan_import,
    refusal,
)
from handsight.collection.sim.objects.urdf import RigidObject, write_object


@dataclass(frozen=True, slots=True, kw_only=True)
class ImportReport:
    """What an import did."""

    name: str
    """Pass it wherever the name of an object set is expected."""
    source: Path
    """The folder of meshes."""
    folder: Path
    """Where the set lies."""
    objects: tuple[ObjectEntry, ...]
    skipped: tuple[SkippedMesh, ...]
    reused: bool
    """Whether the same meshes had been imported with the same settings before, so that nothing was written."""


def import_folder(
    folder: Path,
    name: str,
    *,
    settings: ImportSettings | None = None,
    skip_bad: bool = False,
    progress: Progress | None = None,
) -> ImportReport:
    """Check every mesh below ``folder``, cut each into convex parts and keep them as object set ``name``.

    Args:
        folder: holds obj, stl, ply or glb files, in folders of their own or not.
        name: the set's name from now on.
        settings: how meshes become objects.
        skip_bad: leave bad meshes out instead of refusing the folder.
        progress: called after each mesh that was cut.

    Raises:
        MeshImportError: Wrong arguments, or meshes that cannot be used; names all faults, and nothing was written.
        ObjectSetError: The cache cannot be written.
    """
    return carry_out(plan_import(folder, name, settings=settings, skip_bad=skip_bad), progress=progress)


def carry_out(plan: ImportPlan, *, progress: Progress | None = None) -> ImportReport:
    """Write the set that was planned, whole or not at all.

    Raises:
        MeshImportError: Meshes that cannot be cut into parts or have changed since; nothing was written.
        ObjectSetError: The cache cannot be written.
    """
    skipped = list(plan.skipped)

    def fill(scratch: Path) -> None:
        entries = []
        with Cutter() as cutter:
            for number, item in enumerate(plan.objects, start=1):
                try:
                    entries.append(_write(item, plan, scratch, cutter))
                except MeshFault as fault:
                    skipped.append(SkippedMesh(path=plan.source / item.source, reason=str(fault)))
                if progress is not None:
                    progress(number, len(plan.objects))
        if not entries or (len(entries) < len(plan.objects) and not plan.skip_bad):
            raise MeshImportError(refusal(plan.source, len(plan.objects) + len(plan.skipped), skipped))
        Manifest(name=plan.name, settings=plan.record(), objects=tuple(entries)).write(scratch)

    made = not plan.reused and publish(plan.folder, fill)
    manifest = read_manifest(plan.folder)
    if not made:
        check_same(plan, manifest)
    return ImportReport(
        name=plan.name,
        source=plan.source,
        folder=plan.folder,
        objects=manifest.objects,
        skipped=tuple(skipped),
        reused=not made,
    )


def _write(item: PlannedObject, plan: ImportPlan, scratch: Path, cutter: Cutter) -> ObjectEntry:
    """Read the mesh again, cut it, and write it into a folder of its own.

    Raises:
        MeshFault: The mesh has changed since it was checked, or cannot be cut.
    """
    mesh = check_mesh(plan.source / item.source, root=plan.source, scale=plan.settings.scale, plain=plan.settings.plain)
    if list(mesh.sha256.values()) != list(item.sha256.values()):
        raise MeshFault("changed while it was imported; import again")
    skin, texture, colour = appearance(mesh.looks, item.name)
    place = scratch / item.name
    rigid = RigidObject(
        name=item.name,
        parts=cutter.convex_parts(mesh.solid),
        skin=skin,
        texture=texture,
        colour=colour,
        mass_kg=item.mass_kg,
        friction=plan.settings.friction,
    )
    place.mkdir()
    write_object(rigid, place)
    return ObjectEntry(
        name=item.name,
        source=item.source,
        scale=plan.settings.scale,
        licence=plan.settings.licence,
        sha256=folder_digest(place),
        source_sha256=next(iter(item.sha256.values())),
        split="all",
        mass_kg=item.mass_kg,
        size_m=item.size_m,
    )
