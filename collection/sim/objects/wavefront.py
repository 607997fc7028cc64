"""Wavefront files as PyBullet reads them: convex parts for contact, a textured skin for the picture.

PyBullet takes every ``o`` group of a collision file as one convex hull, which is what keeps a mug hollow. Numbers are
written with fixed decimals, a micrometre for lengths, so that the files have the same bytes on every machine.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ConvexPart:
    """One convex piece of an object."""

    vertices_m: NDArray[np.float64]
    """Shape (V, 3)."""
    triangles: NDArray[np.int64]
    """Corners of each triangle, counter-clockwise seen from outside. Shape (T, 3)."""
    density: float = 1.0
    """Relative to the object's other parts."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Skin:
    """The visible surface of an object as separate triangles."""

    vertices_m: NDArray[np.float64]
    """Shape (T, 3, 3): triangle, corner, coordinate."""
    normals: NDArray[np.float64]
    """Unit normal at each corner. Shape (T, 3, 3)."""
    uv: NDArray[np.float64] | None = None
    """Texture coordinates of each corner; None where there is no texture. Shape (T, 3, 2)."""


def collision_text(parts: Sequence[ConvexPart], origin_m: NDArray[np.float64]) -> str:
    """The parts, with ``origin_m`` moved to the origin."""
    lines: list[str] = []
    first = 1
    for number, part in enumerate(parts):
        lines.append(f"o convex_{number}")
        lines += _rows("v", part.vertices_m - origin_m, 6)
        lines += ["f " + " ".join(str(first + int(corner)) for corner in triangle) for triangle in part.triangles]
        first += len(part.vertices_m)
    return "\n".join(lines) + "\n"


def skin_text(skin: Skin, origin_m: NDArray[np.float64], material_file: str) -> str:
    """The skin, with ``origin_m`` moved to the origin; equal corners are written once."""
    lines = [f"mtllib {material_file}", "o skin"]
    columns = [_unique_rows("v", (skin.vertices_m - origin_m).reshape(-1, 3), 6)]
    if skin.uv is not None:
        columns.append(_unique_rows("vt", skin.uv.reshape(-1, 2), 5))
    columns.append(_unique_rows("vn", skin.normals.reshape(-1, 3), 4))
    for rows, _ in columns:
        lines += rows
    lines.append("usemtl skin")
    joint = "/" if skin.uv is not None else "//"
    corners = [joint.join(str(index) for index in together) for together in zip(*(c[1] for c in columns), strict=True)]
    lines += [f"f {a} {b} {c}" for a, b, c in zip(corners[::3], corners[1::3], corners[2::3], strict=True)]
    return "\n".join(lines) + "\n"


def material_text(texture_file: str | None) -> str:
    """A white material, or one with a texture."""
    lines = ["newmtl skin", "Kd 1 1 1"]
    if texture_file is not None:
        lines.append(f"map_Kd {texture_file}")
    return "\n".join(lines) + "\n"


def _rows(keyword: str, values: NDArray[np.float64], decimals: int) -> Iterable[str]:
    # Adding zero turns a negative zero into a positive one.
    rounded = np.round(values, decimals) + 0.0
    return (f"{keyword} " + " ".join(f"{value:.{decimals}f}" for value in row) for row in rounded.tolist())


def _unique_rows(keyword: str, values: NDArray[np.float64], decimals: int) -> tuple[list[str], list[int]]:
    """Lines without repeats, and for every value the 1-based number of its line."""
    numbers: dict[str, int] = {}
    indices = [numbers.setdefault(line, len(numbers) + 1) for line in _rows(keyword, values, decimals)]
    return list(numbers), indices
