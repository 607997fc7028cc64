"""Reads one mesh file and checks that it can become an object for a table-top grasp."""

from __future__ import annotations

import hashlib
import io
import logging
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray

from handsight.collection.sim.objects.meshes.appearance import lacks_coordinates
from handsight.collection.sim.objects.meshes.companions import Companions
from handsight.collection.sim.objects.meshes.declared import check_ply, check_stl
from handsight.collection.sim.objects.meshes.fault import MAX_TRIANGLES, MeshFault, shown
from handsight.collection.sim.objects.meshes.glb import check_glb
from handsight.collection.sim.objects.meshes.mtl import Material
from handsight.collection.sim.objects.meshes.solid import Solid, make_solid
from handsight.collection.sim.objects.meshes.wavefront_reading import place_pictures, wavefront_for_reader

MAX_FILE_BYTES = 200_000_000
LARGEST_EXTENT_M = (0.01, 0.5)
"""Between a grain and something longer than the workspace is wide."""
_UNITS = ((0.001, "millimetres"), (0.01, "centimetres"), (0.0254, "inches"))
_USUAL_EXTENT_M = 0.15

# Broken files are reported as faults; trimesh would also print tracebacks of its own.
logging.getLogger("trimesh").addHandler(logging.NullHandler())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CheckedMesh:
    """A file that can become an object, in metres."""

    sha256: dict[Path, str]
    """Of the mesh file, which comes first, and of each material and texture file that was read for it."""
    solid: Solid
    """For volume and decomposition."""
    looks: trimesh.Trimesh
    """As in the file, scaled, faces outwards: with its texture coordinates and colours."""


def check_mesh(path: Path, *, root: Path, scale: float, plain: bool = False) -> CheckedMesh:
    """Read a file.

    Args:
        path: the mesh.
        root: the folder outside which nothing is read.
        scale: metres per unit of the file.
        plain: leave materials, textures and colours unread.

    Raises:
        MeshFault: It cannot be used, with the reason and what to do about it.
    """
    content = _content(path)
    companions = Companions(path, root)
    looks = _load(path, content, companions, plain=plain)
    looks.vertices = looks.vertices * scale
    _check_extent(looks.extents, scale)
    solid = make_solid(looks)
    digests = {path: hashlib.sha256(content).hexdigest(), **companions.sha256}
    return CheckedMesh(sha256=digests, solid=solid, looks=looks)


def _content(path: Path) -> bytes:
    try:
        size = path.stat().st_size
        if size == 0:
            raise MeshFault("the file is empty")
        if size > MAX_FILE_BYTES:
            raise MeshFault(
                f"the file has {size / 1e6:.0f} MB, expected at most {MAX_FILE_BYTES / 1e6:.0f} MB; decimate it"
            )
        return path.read_bytes()
    except OSError as error:
        raise MeshFault(f"cannot be read ({error.strerror})") from error


def _load(path: Path, content: bytes, companions: Companions, *, plain: bool) -> trimesh.Trimesh:
    """One mesh with normals of its own shape, and with looks unless ``plain``."""
    kind = path.suffix.lower().removeprefix(".")
    materials: Mapping[str, Material] = {}
    if kind == "obj":
        content, materials = wavefront_for_reader(content, companions, plain=plain)
    elif kind == "glb":
        check_glb(content, textures=not plain)
    elif kind == "ply":
        check_ply(content)
    else:
        check_stl(content)
    try:
        with warnings.catch_warnings():
            # NumPy would take the numbers before those that are none for all that there are.
            warnings.filterwarnings("error", "string or file could not be read to its end", DeprecationWarning)
            scene = trimesh.load_scene(
                io.BytesIO(content), file_type=kind, resolver=companions, process=False, skip_materials=plain
            )
    except Exception as error:
        companions.check()
        # trimesh's readers raise whatever a broken file leads them into.
        raise MeshFault(f"cannot be read ({type(error).__name__}: {shown(str(error))[:200]})") from error
    companions.check()
    place_pictures(scene, materials)
    try:
        _check_triangles(scene)
        whole = scene.to_mesh()
    except UnicodeError as error:  # trimesh hashes the names of a file's parts.
        raise MeshFault("names one of its parts in characters that are none; rename it, or export it again") from error
    # Normals that a file brings may be missing, broken, or turned with the faces; colours may not be wanted.
    return trimesh.Trimesh(
        vertices=whole.vertices, faces=whole.faces, visual=None if plain else whole.visual, process=False
    )


def _check_triangles(scene: trimesh.Scene) -> None:
    """Every copy that the file's graph places counts: a small file can ask for many."""
    placed = [scene.geometry[scene.graph[node][1]] for node in scene.graph.nodes_geometry]
    meshes = [mesh for mesh in placed if isinstance(mesh, trimesh.Trimesh)]
    triangles = sum(len(mesh.faces) for mesh in meshes)
    if triangles == 0:
        raise MeshFault("has no triangles; it is empty, cut off, or of another format than its name says")
    if triangles > MAX_TRIANGLES:
        raise MeshFault(f"has {triangles} triangles, expected at most {MAX_TRIANGLES}; decimate it")
    for mesh in meshes:
        _check_arrays(mesh)


def _check_arrays(mesh: trimesh.Trimesh) -> None:
    bad = int((~np.isfinite(mesh.vertices)).any(axis=1).sum())
    if bad:
        raise MeshFault(f"{bad} of {len(mesh.vertices)} vertices are not finite; repair or leave out the mesh")
    wild = int(((mesh.faces < 0) | (mesh.faces >= len(mesh.vertices))).any(axis=1).sum()) if len(mesh.faces) else 0
    if wild:
        raise MeshFault(f"{wild} of {len(mesh.faces)} triangles name vertices beyond the {len(mesh.vertices)} it has")
    uv = getattr(mesh.visual, "uv", None)
    complete = uv is None or (np.shape(uv) == (len(mesh.vertices), 2) and np.isfinite(uv).all())
    if not complete or lacks_coordinates(mesh):
        raise MeshFault("has texture coordinates that are missing or not finite; pass --plain to do without looks")


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
