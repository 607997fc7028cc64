"""Reads one mesh file and checks that it can become an object for a table-top grasp."""

from __future__ import annotations

import hashlib
import logging
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray

SUFFIXES = (".glb", ".obj", ".ply", ".stl")
MAX_FILE_BYTES = 200_000_000
MAX_TRIANGLES = 100_000
"""Pictures are drawn by software: more triangles than this per object would take most of an attempt's time."""
LARGEST_EXTENT_M = (0.01, 0.5)
"""Between a grain and something longer than the workspace is wide."""
_UNITS = ((0.001, "millimetres"), (0.01, "centimetres"), (0.0254, "inches"))
_USUAL_EXTENT_M = 0.15

# Broken files are reported as faults; trimesh would also print tracebacks of its own.
logging.getLogger("trimesh").addHandler(logging.NullHandler())


class MeshFault(Exception):  # noqa: N818 -- a finding about one file, collected into a MeshImportError, never raised to users
    """Why one file cannot be used."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CheckedMesh:
    """A closed surface in metres."""

    path: Path
    sha256: str
    surface: trimesh.Trimesh
    """Vertices merged, normals outwards, scaled; for volume and decomposition."""
    looks: trimesh.Trimesh
    """As in the file, scaled: with its texture coordinates and colours."""

    @property
    def volume_m3(self) -> float:
        """Enclosed volume."""
        return float(self.surface.volume)


def find_meshes(folder: Path, pattern: str) -> list[Path]:
    """Mesh files below ``folder`` that match ``pattern``, in the order of their paths."""
    return sorted(path for path in folder.glob(pattern) if path.suffix.lower() in SUFFIXES and path.is_file())


def object_names(folder: Path, paths: list[Path]) -> list[str]:
    """A name for each mesh: its path below ``folder``, without what all paths have in common.

    ``025_mug/google_16k/textured.obj`` among other objects of YCB becomes ``025_mug``.
    """
    routes = [path.relative_to(folder).with_suffix("").parts for path in paths]
    alike = len({len(route) for route in routes}) == 1 and len(routes) > 1
    kept = [
        [step for depth, step in enumerate(route) if not alike or len({other[depth] for other in routes}) > 1]
        for route in routes
    ]
    kept = [steps or [route[-1]] for steps, route in zip(kept, routes, strict=True)]
    # Anything but plain characters would have to be escaped in URDF and on the command line.
    return ["-".join("".join(c if c.isalnum() or c in "._" else "-" for c in step) for step in route) for route in kept]


def check_mesh(path: Path, scale: float) -> CheckedMesh:
    """Read a file.

    Raises:
        MeshFault: it cannot be used, with the reason and what to do about it.
    """
    size = path.stat().st_size
    if size == 0:
        raise MeshFault("the file is empty")
    if size > MAX_FILE_BYTES:
        raise MeshFault(
            f"the file has {size / 1e6:.0f} MB, expected at most {MAX_FILE_BYTES / 1e6:.0f} MB; decimate it"
        )
    looks = _load(path)
    _check_triangles(looks)
    looks.vertices = looks.vertices * scale
    _check_extent(looks.extents, scale)
    surface = trimesh.Trimesh(vertices=looks.vertices, faces=looks.faces, process=True)
    surface.merge_vertices()
    _check_closed(surface)
    return CheckedMesh(path=path, sha256=hashlib.sha256(path.read_bytes()).hexdigest(), surface=surface, looks=looks)


def _load(path: Path) -> trimesh.Trimesh:
    try:
        loaded = trimesh.load(path, force="mesh", process=False)
    except Exception as error:
        # trimesh's readers raise whatever a broken file leads them into.
        raise MeshFault(f"cannot be read ({type(error).__name__}: {error})") from error
    if not isinstance(loaded, trimesh.Trimesh) or len(loaded.faces) == 0:
        raise MeshFault("has no triangles")
    return loaded


def _check_triangles(mesh: trimesh.Trimesh) -> None:
    bad = int((~np.isfinite(mesh.vertices)).any(axis=1).sum())
    if bad:
        raise MeshFault(f"{bad} of {len(mesh.vertices)} vertices are not finite; repair or leave out the mesh")
    if len(mesh.faces) > MAX_TRIANGLES:
        raise MeshFault(f"has {len(mesh.faces)} triangles, expected at most {MAX_TRIANGLES}; decimate it")


def _check_extent(extent_m: NDArray[np.float64], scale: float) -> None:
    largest = float(extent_m.max())
    low, high = LARGEST_EXTENT_M
    if low <= largest <= high:
        return
    text = " x ".join(f"{extent:.3g}" for extent in extent_m)
    raise MeshFault(f"is {text} m, expected a largest extent of {low} to {high} m; {_hint(largest, scale)}")


def _hint(largest_m: float, scale: float) -> str:
    if largest_m <= 0:
        return "all its vertices coincide"
    for factor, unit in _UNITS:
        if LARGEST_EXTENT_M[0] <= largest_m * factor <= LARGEST_EXTENT_M[1]:
            return f"if the file is in {unit}, pass --scale {scale * factor:g}"
    return f"--scale {scale * _USUAL_EXTENT_M / largest_m:.2g} would make it {_USUAL_EXTENT_M} m long"


def _check_closed(surface: trimesh.Trimesh) -> None:
    if not surface.is_watertight:
        edges, uses = np.unique(surface.edges_sorted, axis=0, return_counts=True)
        open_edges = int((uses != 2).sum())
        raise MeshFault(
            f"is not watertight: {open_edges} of {len(edges)} edges do not join two triangles; close its holes, "
            "for example with MeshLab or `trimesh.repair`"
        )
    if not surface.is_winding_consistent:
        raise MeshFault("is not watertight: neighbouring triangles face opposite ways; make its normals consistent")
    if surface.volume < 0:
        surface.invert()
    if surface.volume <= 0:
        raise MeshFault("encloses no volume")
