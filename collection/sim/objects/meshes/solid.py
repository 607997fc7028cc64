"""Whether a surface encloses one solid body, and which way its faces look."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from handsight.collection.sim.objects.meshes.fault import MeshFault
from handsight.collection.sim.objects.meshes.repeats import without_repeats

MAX_PIECES = 1000
MAX_BODIES = 12
"""Each needs a convex part of its own, and physics slows down with every one."""
MAX_GAP_M = 0.001
"""Pieces whose bounding boxes are further apart do not touch."""
MIN_THICKNESS_M = 0.0002
"""About two sheets of paper: physics cannot hold anything thinner."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Pieces:
    """Surfaces of a mesh that share no edge."""

    label: NDArray[np.int64]
    """The piece that each triangle belongs to. Shape (T,)."""
    volume_m3: NDArray[np.float64]
    """Signed: negative where the faces look inwards. Shape (P,)."""
    low_m: NDArray[np.float64]
    high_m: NDArray[np.float64]
    """Bounding boxes. Shape (P, 3)."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solid:
    """A closed surface in metres, corners merged, faces outwards."""

    surface: trimesh.Trimesh
    bodies: tuple[trimesh.Trimesh, ...]
    """The surface cut up: one for each piece that encloses something, with the hollows in it."""

    @property
    def volume_m3(self) -> float:
        """Enclosed volume; what two bodies share counts twice."""
        return float(self.surface.volume)


def make_solid(mesh: trimesh.Trimesh) -> Solid:
    """What ``mesh`` encloses; faces that look inwards are turned around, and repeated ones left out, in ``mesh`` too.

    A piece within another one whose faces look inwards is a hollow and stays as it is.

    Args:
        mesh: in metres; every index names a vertex.

    Raises:
        MeshFault: The surface is open or inconsistent, encloses nothing, or falls into pieces.
    """
    surface = trimesh.Trimesh(vertices=mesh.vertices, faces=mesh.faces, process=False)
    surface.merge_vertices()
    # Slivers whose corners have become one belong to no surface, and would count as open edges.
    first, second, third = surface.faces.T
    whole = np.flatnonzero((first != second) & (second != third) & (third != first))
    surface.update_faces(whole)
    kept = without_repeats(np.asarray(surface.faces))
    if len(kept) < len(whole):
        lost = whole[~np.isin(np.arange(len(whole)), kept)]
        surface.update_faces(kept)
        mesh.update_faces(~np.isin(np.arange(len(mesh.faces)), lost))
        whole = whole[kept] - np.searchsorted(lost, whole[kept])
    surface.remove_unreferenced_vertices()
    _check_closed(surface)
    pieces = _pieces(surface)
    _check_together(pieces)
    outermost = _outermost(pieces)
    inwards = pieces.volume_m3[outermost] < 0
    volume_m3 = np.where(inwards, -pieces.volume_m3, pieces.volume_m3)
    _check_thickness(float(volume_m3.sum()), float(surface.area))
    turn = inwards[pieces.label]
    surface.faces = _turned(surface.faces, turn)
    mesh.faces = _turned(mesh.faces, np.isin(np.arange(len(mesh.faces)), whole[turn]))
    body = np.where(volume_m3 > 0, np.arange(len(volume_m3)), outermost)[pieces.label]
    return Solid(surface=surface, bodies=_bodies(surface, body))


def _bodies(surface: trimesh.Trimesh, body: NDArray[np.int64]) -> tuple[trimesh.Trimesh, ...]:
    """The surface cut up; ``body``, shape (T,), is the number of the body that each triangle belongs to."""
    numbers = np.unique(body)
    if len(numbers) > MAX_BODIES:
        raise MeshFault(
            f"consists of {len(numbers)} bodies, expected at most {MAX_BODIES}; unite them, for example with MeshLab"
        )
    return tuple(
        trimesh.Trimesh(vertices=surface.vertices, faces=surface.faces[body == number], process=True)
        for number in numbers
    )


def _check_closed(surface: trimesh.Trimesh) -> None:
    edges, uses = np.unique(surface.edges_sorted, axis=0, return_counts=True)
    open_edges = int((uses != 2).sum())
    if not len(edges):
        raise MeshFault("encloses nothing: every triangle has two corners in one place")
    if open_edges:
        raise MeshFault(
            f"is not watertight: {open_edges} of {len(edges)} edges do not join two triangles; close its holes, "
            "for example with MeshLab or `trimesh.repair`"
        )
    if not surface.is_winding_consistent:
        raise MeshFault("is not watertight: neighbouring triangles face opposite ways; make its normals consistent")


def _pieces(surface: trimesh.Trimesh) -> _Pieces:
    count, label = _components(surface.face_adjacency, len(surface.faces))
    if count > MAX_PIECES:
        raise MeshFault(f"has {count} pieces, expected at most {MAX_PIECES}; unite them")
    corners = np.asarray(surface.triangles - surface.bounds.mean(axis=0))  # (T, 3, 3)
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(low, label, corners.min(axis=1))
    np.maximum.at(high, label, corners.max(axis=1))
    volume = np.bincount(label, weights=np.linalg.det(corners) / 6).astype(np.float64)
    return _Pieces(label=label, volume_m3=volume, low_m=low, high_m=high)


def _components(pairs: NDArray[np.int64], size: int) -> tuple[int, NDArray[np.int64]]:
    """How many groups ``size`` things form when the ``pairs``, shape (N, 2), belong together, and the group of each."""
    joined = coo_array((np.ones(len(pairs), np.int8), (pairs[:, 0], pairs[:, 1])), shape=(size, size))
    count, label = connected_components(joined, directed=False)
    return int(count), np.asarray(label, np.int64)


def _check_together(pieces: _Pieces) -> None:
    """The pieces of one rigid body touch. Boxes that do not are proof that some pieces do not."""
    low, high = pieces.low_m - MAX_GAP_M / 2, pieces.high_m + MAX_GAP_M / 2
    near = np.argwhere(((low[:, None] <= high) & (low <= high[:, None])).all(axis=2))  # (N, 2)
    groups = _components(near, len(low))[0]
    if groups > 1:
        raise MeshFault(
            f"consists of {groups} parts that do not touch, expected one body; save each as a file of its own, or "
            "delete what floats about"
        )


def _outermost(pieces: _Pieces) -> NDArray[np.int64]:
    """For each piece the largest one around it, which may be itself. Shape (P,)."""
    low, high = pieces.low_m, pieces.high_m
    within = ((low[:, None] >= low) & (high[:, None] <= high)).all(axis=2)  # (P, P): row within column
    size = np.prod(high - low, axis=1)
    return np.asarray(np.where(within, size, -1.0).argmax(axis=1), np.int64)


def _turned(faces: NDArray[np.int64], which: NDArray[np.bool_]) -> NDArray[np.int64]:
    return np.where(which[:, None], faces[:, ::-1], faces)


def _check_thickness(volume_m3: float, area_m2: float) -> None:
    # A sheet of thickness t and area a has the volume t a and the surface 2 a.
    thickness_m = 2 * volume_m3 / area_m2 if area_m2 > 0 else 0.0
    if thickness_m < MIN_THICKNESS_M:
        raise MeshFault(
            f"encloses next to no volume: it is {max(thickness_m, 0) * 1e3:.2g} mm thick on average, expected at least "
            f"{MIN_THICKNESS_M * 1e3:g} mm; give it a thickness"
        )
