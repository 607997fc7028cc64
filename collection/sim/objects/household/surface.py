"""From convex solids to triangles: the same surface for collision and for the picture."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handsight.collection.sim.objects.household.finishes import Atlas
from handsight.collection.sim.objects.household.solids import Array, Solid
from handsight.collection.sim.objects.wavefront import ConvexPart, Skin

SMOOTH_BELOW_DEG = 50.0
"""Faces that meet at less than this angle are shaded as one curved surface."""
_DECIMALS_MM = 3
_MM = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Face:
    """A flat polygon, counter-clockwise seen from outside."""

    corners: Array
    """[mm]. Shape (K, 3)."""
    uv: Array
    """Texture coordinates. Shape (K, 2)."""

    @property
    def area_normal(self) -> Array:
        """The normal, as long as twice the area (Newell's method, which thin and slightly bent polygons survive)."""
        normal: Array = np.cross(self.corners, np.roll(self.corners, -1, axis=0)).sum(axis=0)
        return normal

    @property
    def key(self) -> frozenset[tuple[float, ...]]:
        """What two faces that lie on each other have in common."""
        return frozenset(map(_key, self.corners))


def faces(solid: Solid, atlas: Atlas) -> list[Face]:
    """All faces of one solid: sides from bottom to top, then the two ends."""
    return [*_sides(solid, atlas), *_ends(solid, atlas)]


def _sides(solid: Solid, atlas: Atlas) -> Iterator[Face]:
    placed, count = solid.placed, solid.rings.shape[1]
    painted = count if solid.side_edges is None else solid.side_edges
    # Heights along the loft, so that a label is not stretched by a short piece of it.
    steps = np.linalg.norm(np.diff(solid.rings.mean(axis=1), axis=0), axis=1)
    heights = np.concatenate([[0.0], np.cumsum(steps)]) / steps.sum()
    around = _shares(solid.rings[0], painted)
    for ring in range(len(placed) - 1):
        low, high = float(heights[ring]), float(heights[ring + 1])
        for corner in range(count):
            after = (corner + 1) % count
            finish = solid.side if corner < painted else solid.ends
            whole = finish.each_face or corner >= painted
            left, right = (0.0, 1.0) if whole else (around[corner], around[after] if after else 1.0)
            quad = placed[[ring, ring, ring + 1, ring + 1], [corner, after, after, corner]]
            uv = [(left, low), (right, low), (right, high), (left, high)]
            yield Face(quad, np.array([atlas.uv(finish, u, v) for u, v in uv]))


def _shares(outline: Array, edges: int) -> list[float]:
    """How far around the first ``edges`` edges of an outline each of its corners lies, from 0 to 1."""
    lengths = np.linalg.norm(np.roll(outline, -1, axis=0) - outline, axis=1)[:edges]
    return [0.0, *(np.cumsum(lengths) / lengths.sum()).tolist()]


def _ends(solid: Solid, atlas: Atlas) -> Iterator[Face]:
    for ring, flipped in ((0, True), (-1, False)):
        outline = solid.rings[ring] - solid.rings[ring].min(axis=0)
        # The two widest directions of the outline span the tile.
        first, second = sorted(np.argsort(-outline.max(axis=0), kind="stable")[:2])
        flat = outline[:, [first, second]] / outline[:, [first, second]].max(axis=0)
        uv = np.array([atlas.uv(solid.ends, float(u), float(v)) for u, v in flat])
        order = slice(None, None, -1) if flipped else slice(None)
        yield Face(solid.placed[ring][order], uv[order])


def collision_part(solid: Solid) -> ConvexPart:
    """The solid's corners and triangles [m]."""
    count = solid.rings.shape[1]
    corners = solid.placed.reshape(-1, 3)
    triangles: list[tuple[int, int, int]] = []
    for ring in range(len(solid.rings) - 1):
        for corner in range(count):
            a, b = ring * count + corner, ring * count + (corner + 1) % count
            triangles += [(a, b, b + count), (a, b + count, a + count)]
    last = len(corners) - count
    for corner in range(1, count - 1):
        triangles += [(0, corner + 1, corner), (last, last + corner, last + corner + 1)]
    return ConvexPart(vertices_m=corners * _MM, triangles=np.array(triangles), density=solid.density)


def skin(solids: Sequence[Solid], atlas: Atlas) -> Skin:
    """What can be seen of an object: faces on which two solids touch are inside and left out."""
    everything = [face for solid in solids for face in faces(solid, atlas)]
    seen: dict[frozenset[tuple[float, ...]], int] = defaultdict(int)
    for face in everything:
        seen[face.key] += 1
    outside = [face for face in everything if seen[face.key] == 1 and np.linalg.norm(face.area_normal) > 1e-6]
    normals = _smooth_normals(outside)
    vertices, uv, shading = [], [], []
    for face, normal in zip(outside, normals, strict=True):
        for corner in range(1, len(face.corners) - 1):
            fan = [0, corner, corner + 1]
            vertices.append(face.corners[fan])
            uv.append(face.uv[fan])
            shading.append(normal[fan])
    return Skin(vertices_m=np.stack(vertices) * _MM, normals=np.stack(shading), uv=np.stack(uv))


def _smooth_normals(outside: Sequence[Face]) -> list[Array]:
    """A unit normal per corner of every face: the mean over the faces around it that bend little."""
    around: dict[tuple[float, ...], list[int]] = defaultdict(list)
    for index, face in enumerate(outside):
        for corner in face.corners:
            around[_key(corner)].append(index)
    weighted = np.stack([face.area_normal for face in outside])  # (F, 3)
    units = weighted / np.linalg.norm(weighted, axis=1, keepdims=True)
    flat_enough = math.cos(math.radians(SMOOTH_BELOW_DEG))
    normals = []
    for face, unit in zip(outside, units, strict=True):
        rows = []
        for corner in face.corners:
            near = around[_key(corner)]
            total = weighted[near][units[near] @ unit > flat_enough].sum(axis=0)
            rows.append(total / np.linalg.norm(total))
        normals.append(np.stack(rows))
    return normals


def _key(corner: NDArray[np.float64]) -> tuple[float, ...]:
    # Adding zero turns a negative zero, which would print and hash differently, into a positive one.
    return tuple((np.round(corner, _DECIMALS_MM) + 0.0).tolist())
