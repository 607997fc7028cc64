"""Makes an object set of a folder of meshes."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from handsight.collection.errors import MeshImportError
from handsight.collection.sim.objects.cache import publish
from handsight.collection.sim.objects.catalogue import OBJECT_SETS, imported_folder
from handsight.collection.sim.objects.manifest import (
    MANIFEST_FILE,
    Manifest,
    ObjectEntry,
    folder_digest,
    read_manifest,
)
from handsight.collection.sim.objects.meshes.appearance import appearance
from handsight.collection.sim.objects.meshes.decomposition import convex_parts
from handsight.collection.sim.objects.meshes.mesh_file import (
    SUFFIXES,
    CheckedMesh,
    MeshFault,
    check_mesh,
    find_meshes,
    object_names,
)
from handsight.collection.sim.objects.urdf import RigidObject, write_object

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]*")


@dataclass(frozen=True, slots=True, kw_only=True)
class ImportSettings:
    """How meshes become objects."""

    scale: float = 1.0
    """Metres per unit of the files."""
    density_kg_m3: float = 400.0
    """Mass per enclosed volume; most household things are hollow and lighter than water."""
    friction: float = 0.8
    """Lateral friction of the surfaces."""
    licence: str = "unknown"
    """Terms under which the meshes are used; recorded with each object."""
    pattern: str = "**/*"
    """Which files of the folder are read."""

    def faults(self) -> list[str]:
        """What is wrong with the settings, if anything."""
        faults = []
        if not self.pattern or Path(self.pattern).is_absolute():
            faults.append(f"pattern is {self.pattern!r}, expected a pattern below the folder, such as '*/*.obj'")
        limits = (("scale", self.scale), ("density_kg_m3", self.density_kg_m3), ("friction", self.friction))
        faults += [
            f"{name} is {value:g}, expected positive and finite"
            for name, value in limits
            if not (math.isfinite(value) and value > 0)
        ]
        return faults


@dataclass(frozen=True, slots=True, kw_only=True)
class SkippedMesh:
    """A file that did not become an object."""

    path: Path
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ImportReport:
    """What an import did."""

    name: str
    """Pass it wherever the name of an object set is expected."""
    folder: Path
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
    progress: Callable[[int, int], None] | None = None,
) -> ImportReport:
    """Check every mesh below ``folder``, cut each into convex parts and keep them as object set ``name``.

    Args:
        folder: holds obj, stl, ply or glb files, in folders of their own or not.
        name: the set's name from now on.
        settings: how meshes become objects.
        skip_bad: leave bad meshes out instead of refusing the folder.
        progress: called with the number of meshes done and in total.

    Raises:
        MeshImportError: wrong arguments, or meshes that cannot be used; names all faults, and nothing was written.
        ObjectSetError: the cache cannot be written.
    """
    settings = settings or ImportSettings()
    paths = _check_request(folder, name, settings)
    meshes, skipped = _check_meshes(folder, paths, settings.scale)
    if skipped and (not skip_bad or not meshes):
        raise MeshImportError(_refusal(folder, len(paths), skipped))
    recorded = _recorded_settings(folder, settings, meshes)
    target = imported_folder(name)

    def fill(scratch: Path) -> None:
        entries = []
        for number, (object_name, mesh) in enumerate(meshes.items(), start=1):
            entries.append(_write(object_name, mesh, folder, scratch, settings))
            if progress is not None:
                progress(number, len(meshes))
        Manifest(name=name, settings=recorded, objects=tuple(entries)).write(scratch)

    made = not (target / MANIFEST_FILE).is_file() and publish(target, fill)
    manifest = read_manifest(target)
    if not made and manifest.settings != recorded:
        raise MeshImportError(
            f"object set {name!r} exists in {target} and was made from other meshes or settings; "
            "choose another name, or delete that folder first"
        )
    return ImportReport(name=name, folder=target, objects=manifest.objects, skipped=tuple(skipped), reused=not made)


def _check_request(folder: Path, name: str, settings: ImportSettings) -> list[Path]:
    """The mesh files to read.

    Raises:
        MeshImportError: the arguments make no sense; names all faults.
    """
    faults = settings.faults()
    if not _NAME.fullmatch(name):
        faults.append(f"set name is {name!r}, expected letters, digits, - and _, starting with a letter or digit")
    if name in OBJECT_SETS:
        faults.append(f"set name {name!r} is taken by a set that comes with handsight; choose another one")
    paths: list[Path] = []
    if not folder.is_dir():
        faults.append(f"{folder} is {'a file' if folder.exists() else 'missing'}, expected a folder of meshes")
    elif not faults:
        paths = find_meshes(folder, settings.pattern)
        if not paths:
            kinds = ", ".join(SUFFIXES)
            faults.append(f"{folder} holds no mesh that matches {settings.pattern!r}, expected files of kind {kinds}")
    if faults:
        raise MeshImportError("; ".join(faults))
    return paths


def _check_meshes(
    folder: Path, paths: Sequence[Path], scale: float
) -> tuple[dict[str, CheckedMesh], list[SkippedMesh]]:
    """Usable meshes by object name, and the others."""
    meshes: dict[str, CheckedMesh] = {}
    skipped = []
    names = object_names(folder, list(paths))
    repeated = {name for name, count in Counter(names).items() if count > 1}
    for name, path in zip(names, paths, strict=True):
        try:
            if name in repeated and name in meshes:
                raise MeshFault(f"gives object {name!r} a second time; choose one kind of file with --pattern")
            meshes[name] = check_mesh(path, scale)
        except MeshFault as fault:
            skipped.append(SkippedMesh(path=path, reason=str(fault)))
    return meshes, skipped


def _refusal(folder: Path, total: int, skipped: Sequence[SkippedMesh]) -> str:
    lines = [f"{item.path.relative_to(folder)}: {item.reason}" for item in skipped]
    advice = "nothing was written" if len(skipped) == total else "nothing was written; --skip-bad leaves them out"
    return f"{len(skipped)} of {total} meshes in {folder} cannot be used, {advice}:\n  " + "\n  ".join(lines)


def _recorded_settings(folder: Path, settings: ImportSettings, meshes: dict[str, CheckedMesh]) -> dict[str, object]:
    """What decides the set's content, as JSON values: equal means that importing again would change nothing."""
    sources = {name: mesh.sha256 for name, mesh in meshes.items()}
    return {"folder": folder.resolve().name, "sources": sources, **asdict(settings)}


def _write(name: str, mesh: CheckedMesh, folder: Path, scratch: Path, settings: ImportSettings) -> ObjectEntry:
    parts = convex_parts(mesh.surface)
    if not parts:
        raise MeshImportError(f"{mesh.path}: CoACD found no convex parts in it; repair or leave out the mesh")
    skin, texture, colour = appearance(mesh.looks, name)
    mass_kg = round(max(mesh.volume_m3 * settings.density_kg_m3, 0.001), 4)
    place = scratch / name
    place.mkdir()
    item = RigidObject(
        name=name,
        parts=parts,
        skin=skin,
        texture=texture,
        colour=colour,
        mass_kg=mass_kg,
        friction=settings.friction,
    )
    write_object(item, place)
    x_m, y_m, z_m = mesh.surface.extents.round(4).tolist()
    return ObjectEntry(
        name=name,
        source=mesh.path.relative_to(folder).as_posix(),
        scale=settings.scale,
        licence=settings.licence,
        sha256=folder_digest(place),
        source_sha256=mesh.sha256,
        split="all",
        mass_kg=mass_kg,
        size_m=(x_m, y_m, z_m),
    )
