"""What an import would make of a folder: every mesh read and checked, nothing written."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from handsight.collection.errors import MeshImportError
from handsight.collection.sim.objects.cache import CACHE_VARIABLE
from handsight.collection.sim.objects.catalogue import OBJECT_SETS, imported_folder
from handsight.collection.sim.objects.manifest import MANIFEST_FILE, Manifest, read_manifest
from handsight.collection.sim.objects.meshes.appearance import has_texture
from handsight.collection.sim.objects.meshes.fault import MeshFault, shown
from handsight.collection.sim.objects.meshes.finding import (
    SUFFIXES,
    check_name,
    check_place,
    find_meshes,
    object_names,
    other_files,
)
from handsight.collection.sim.objects.meshes.mesh_file import check_mesh
from handsight.datasets.errors import counted
from handsight.datasets.writable import folder_fault, link_fault

Progress = Callable[[int, int], None]
"""Called with the number of meshes done and in total."""
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]*")
_MIN_MASS_KG = 0.001


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
    plain: bool = False
    """Leave materials, textures and colours unread; every object gets a colour drawn from its name."""

    def faults(self) -> list[str]:
        """What is wrong with the settings, if anything."""
        faults = []
        if not self.pattern or Path(self.pattern).is_absolute() or ".." in Path(self.pattern).parts:
            faults.append(f"pattern is {self.pattern!r}, expected a pattern below the folder, such as '*/*.obj'")
        limits = (("scale", self.scale), ("density_kg_m3", self.density_kg_m3), ("friction", self.friction))
        faults += [
            f"{name} is {value:g}, expected positive and finite"
            for name, value in limits
            if not (math.isfinite(value) and value > 0)
        ]
        if not self.licence.isprintable():
            faults.append(f"licence is {self.licence!r}, expected printable text")
        return faults


@dataclass(frozen=True, slots=True, kw_only=True)
class SkippedMesh:
    """A file that did not become an object."""

    path: Path
    reason: str

    def line(self, folder: Path) -> str:
        """Both on one line, the path relative to ``folder``."""
        return f"{shown(self.path.relative_to(folder))}: {self.reason}"


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedObject:
    """A mesh that can become an object."""

    name: str
    source: str
    """The mesh file, relative to the folder."""
    sha256: dict[str, str]
    """Of the mesh file and of the material and texture files it names, by their paths relative to the folder."""
    size_m: tuple[float, float, float]
    mass_kg: float
    triangles: int
    textured: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class ImportPlan:
    """What an import would do."""

    name: str
    source: Path
    """The folder of meshes."""
    folder: Path
    """Where the set lies, or will lie."""
    settings: ImportSettings
    objects: tuple[PlannedObject, ...]
    skipped: tuple[SkippedMesh, ...]
    skip_bad: bool
    reused: bool
    """Whether the same meshes were imported with the same settings before, so that nothing is left to do."""

    def record(self) -> dict[str, Any]:
        """What decides the set's content, as JSON values: equal means that importing again would change nothing."""
        sources = {path: digest for item in self.objects for path, digest in item.sha256.items()}
        return {"folder": shown(self.source.resolve().name), "sources": sources, **asdict(self.settings)}


def plan_import(
    folder: Path,
    name: str,
    *,
    settings: ImportSettings | None = None,
    skip_bad: bool = False,
    progress: Progress | None = None,
) -> ImportPlan:
    """Check every mesh below ``folder``.

    Meshes are not kept: a large collection would not fit into memory.

    Args:
        folder: holds obj, stl, ply or glb files, in folders of their own or not.
        name: the set's name from now on.
        settings: how meshes become objects.
        skip_bad: leave bad meshes out instead of refusing the folder.
        progress: called after each mesh.

    Raises:
        MeshImportError: Wrong arguments, meshes that cannot be used, a name that is taken, or a place where nothing can
            be written; names all faults.
    """
    settings = settings or ImportSettings()
    paths = _check_request(folder, name, settings)
    _check_target(imported_folder(name))
    objects, skipped = _check_meshes(folder, paths, settings, progress)
    if skipped and (not skip_bad or not objects):
        raise MeshImportError(refusal(folder, len(paths), skipped))
    plan = ImportPlan(
        name=name,
        source=folder,
        folder=imported_folder(name),
        settings=settings,
        objects=tuple(objects),
        skipped=tuple(skipped),
        skip_bad=skip_bad,
        reused=(imported_folder(name) / MANIFEST_FILE).is_file(),
    )
    if plan.reused:
        check_same(plan, read_manifest(plan.folder))
    elif plan.folder.exists():
        raise MeshImportError(f"{plan.folder} exists and holds no object set; choose another name, or delete it first")
    return plan


def check_same(plan: ImportPlan, manifest: Manifest) -> None:
    """Refuse a name under which something else was imported.

    Raises:
        MeshImportError: The set that exists was made from other meshes or settings.
    """
    if manifest.settings != plan.record():
        raise MeshImportError(
            f"object set {plan.name!r} exists in {plan.folder} and was made from other meshes or settings; "
            "choose another name, or delete that folder first"
        )


def refusal(folder: Path, total: int, skipped: Sequence[SkippedMesh]) -> str:
    """The message that names all bad meshes, one a line."""
    lines = [item.line(folder) for item in skipped]
    advice = "nothing was written" if len(skipped) == total else "nothing was written; --skip-bad leaves them out"
    return (
        f"{len(skipped)} of {counted(total, 'mesh', 'meshes')} in {shown(folder)} cannot be used, {advice}:\n  "
        + "\n  ".join(lines)
    )


def _check_request(folder: Path, name: str, settings: ImportSettings) -> list[Path]:
    """The mesh files to read.

    Raises:
        MeshImportError: The arguments make no sense; names all faults.
    """
    faults = settings.faults()
    if not _NAME.fullmatch(name):
        faults.append(f"set name is {name!r}, expected letters, digits, - and _, starting with a letter or digit")
    if name in OBJECT_SETS:
        faults.append(f"set name {name!r} is taken by a set that comes with handsight; choose another one")
    paths: list[Path] = []
    if (link := link_fault(folder)) is not None:
        faults.append(f"{link}, expected a folder of meshes")
    elif not folder.is_dir():
        what = "a file" if folder.exists() else "missing"
        faults.append(f"{shown(folder)} is {what}, expected a folder of meshes")
    elif not faults:
        paths = _find(folder, settings.pattern)
    if faults:
        raise MeshImportError("; ".join(faults))
    return paths


def _check_target(target: Path) -> None:
    """Refuse a place where no set can be written, before the meshes are read.

    Raises:
        MeshImportError: A link there leads nowhere, or the disk takes no new files.
    """
    if (fault := link_fault(target)) is not None:
        raise MeshImportError(f"{fault}: remove the link, or choose another name")
    if (fault := folder_fault(target.parent)) is not None:
        raise MeshImportError(
            f"no object set can be written to {target}: {fault}; set {CACHE_VARIABLE} to another folder"
        )


def _find(folder: Path, pattern: str) -> list[Path]:
    try:
        paths = find_meshes(folder, pattern)
    except ValueError as error:
        raise MeshImportError(f"pattern is {pattern!r} ({error}), expected one such as '*/*.obj'") from error
    if not paths:
        raise MeshImportError(
            f"{shown(folder)} holds no mesh that matches {pattern!r}, expected files of kind {', '.join(SUFFIXES)}; "
            f"there are {other_files(folder)}"
        )
    return paths


def _check_meshes(
    folder: Path, paths: Sequence[Path], settings: ImportSettings, progress: Progress | None
) -> tuple[list[PlannedObject], list[SkippedMesh]]:
    """Usable meshes, and the others."""
    objects: dict[str, PlannedObject] = {}
    skipped = []
    for number, (name, path) in enumerate(zip(object_names(folder, paths), paths, strict=True), start=1):
        try:
            check_place(folder, path)
            check_name(name, taken_by=objects[name].source if name in objects else None)
            objects[name] = _planned(name, folder, path, settings)
        except MeshFault as fault:
            skipped.append(SkippedMesh(path=path, reason=str(fault)))
        if progress is not None:
            progress(number, len(paths))
    return list(objects.values()), skipped


def _planned(name: str, folder: Path, path: Path, settings: ImportSettings) -> PlannedObject:
    mesh = check_mesh(path, root=folder, scale=settings.scale, plain=settings.plain)
    x_m, y_m, z_m = mesh.solid.surface.extents.round(4).tolist()
    return PlannedObject(
        name=name,
        source=path.relative_to(folder).as_posix(),
        sha256={_relative(one, folder): digest for one, digest in mesh.sha256.items()},
        size_m=(x_m, y_m, z_m),
        mass_kg=round(max(mesh.solid.volume_m3 * settings.density_kg_m3, _MIN_MASS_KG), 4),
        triangles=len(mesh.looks.faces),
        textured=has_texture(mesh.looks),
    )


def _relative(path: Path, folder: Path) -> str:
    return path.resolve().relative_to(folder.resolve()).as_posix()
