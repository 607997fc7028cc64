"""Convex solids from which household objects are put together, with the places where their texture goes.

A solid is a loft: cross-sections with the same number of corners, joined in order. Several convex solids make a hollow
mug or an open ring whose hollow is real for the fingers as well as for the camera, since the same faces serve
collision and picture. Lengths are in **millimetres**, as in catalogues; z is up in the pose in which an object is
usually kept.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from handsight.collection.sim.objects.household.finishes import Finish

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solid:
    """A convex loft with a finish on its side and one on its two ends."""

    rings: Array
    """Cross-sections from bottom to top, each counter-clockwise seen from the top [mm]. Shape (R, K, 3)."""
    side: Finish
    ends: Finish
    pose: Array
    """From the frame of ``rings`` to the object's. Shape (4, 4)."""
    density: float = 1.0
    """Relative to the other solids of the object; decides where its centre of mass lies."""
    side_edges: int | None = None
    """How many edges of the outline, from its first corner, carry ``side``; the others carry ``ends``. None: all."""

    @property
    def placed(self) -> Array:
        """Cross-sections in the object's frame [mm]. Shape (R, K, 3)."""
        placed: Array = self.rings @ self.pose[:3, :3].T + self.pose[:3, 3]
        return placed

    def at(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Solid:
        """The solid shifted [mm]."""
        pose = self.pose.copy()
        pose[:3, 3] += (x, y, z)
        return replace(self, pose=pose)

    def turned(self, axis: str, degrees: float) -> Solid:
        """The solid turned about the object's ``x``, ``y`` or ``z`` axis."""
        first, second = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
        turn = np.eye(4)
        cos, sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
        turn[first, first] = turn[second, second] = cos
        turn[first, second], turn[second, first] = -sin, sin
        return replace(self, pose=turn @ self.pose)

    def weighing(self, density: float) -> Solid:
        """The solid with another relative density."""
        return replace(self, density=density)


def disc(sides: int, radius: float, radius_y: float | None = None) -> Array:
    """Corners of a regular polygon, or of one stretched along y, with an edge facing +x. Shape (sides, 2)."""
    angle = (np.arange(sides) + 0.5) * (2 * math.pi / sides)
    return np.stack([radius * np.cos(angle), (radius if radius_y is None else radius_y) * np.sin(angle)], axis=1)


def rectangle(x: float, y: float, chamfer: float = 0.0) -> Array:
    """Corners of a centred rectangle, cut off by ``chamfer`` where it is positive. Shape (4, 2) or (8, 2)."""
    a, b, c = 0.5 * x, 0.5 * y, chamfer
    if not chamfer:
        return np.array([(a, -b), (a, b), (-a, b), (-a, -b)])
    return np.array(
        [(a, b - c), (a - c, b), (c - a, b), (-a, b - c), (-a, c - b), (c - a, -b), (a - c, -b), (a, c - b)]
    )


def loft(sections: Sequence[tuple[float, Array]], side: Finish, ends: Finish | None = None) -> Solid:
    """Flat outlines, each (K, 2), stacked at ascending heights."""
    rings = [np.column_stack([outline, np.full(len(outline), height)]) for height, outline in sections]
    return Solid(rings=np.stack(rings), side=side, ends=ends or side, pose=np.eye(4))


def prism(outline: Array, height: float, side: Finish, ends: Finish | None = None) -> Solid:
    """An outline, (K, 2), standing on z = 0."""
    return loft([(0.0, outline), (height, outline)], side, ends)


def box(x: float, y: float, z: float, side: Finish, ends: Finish | None = None) -> Solid:
    """A cuboid standing on z = 0."""
    return prism(rectangle(x, y), z, side, ends)


def lathe(profile: Sequence[tuple[float, float]], sides: int, side: Finish, ends: Finish | None = None) -> Solid:
    """A turned solid; ``profile`` holds (height, radius) from bottom to top and must bulge outwards."""
    return loft([(height, disc(sides, radius)) for height, radius in profile], side, ends)


def rod(length: float, radius: float, sides: int, side: Finish, ends: Finish | None = None) -> Solid:
    """A straight rod along x, centred at the origin."""
    return prism(disc(sides, radius), length, side, ends).at(z=-0.5 * length).turned("y", 90)


def wall(
    outer: Sequence[tuple[float, float]],
    inner: tuple[float, float],
    segments: int,
    side: Finish,
    inside: Finish | None = None,
) -> list[Solid]:
    """A turned wall in ``segments`` convex pieces.

    Args:
        outer: (height, radius) of the outside from bottom to top; must bulge outwards.
        inner: radius of the inside at the bottom and at the top.
        segments: number of pieces; the outside has two facets per piece, the inside one.
        side: the outside; it runs once around.
        inside: the inside and the rim, by default as the outside.
    """
    low, high = outer[0][0], outer[-1][0]
    step = 2 * math.pi / segments
    rings = []
    for height, radius in outer:
        hollow = inner[0] + (inner[1] - inner[0]) * (height - low) / (high - low)
        corners = [(radius, 0.0), (radius, 0.5 * step), (radius, step), (hollow, step), (hollow, 0.0)]
        rings.append([(r * math.cos(angle), r * math.sin(angle), height) for r, angle in corners])
    first = Solid(rings=np.array(rings), side=side, ends=inside or side, pose=np.eye(4), side_edges=2)
    return [
        replace(first.turned("z", math.degrees(number * step)), side=side.part(number, segments))
        for number in range(segments)
    ]


def sweep(path: Sequence[tuple[float, float]], sections: Sequence[Array], finish: Finish) -> list[Solid]:
    """Convex pieces along a bent path in the xz plane, mitred where they meet.

    Args:
        path: (x, z) of the joints.
        sections: outline at each joint, (K, 2): first coordinate in the plane of the path, second along y.
        finish: what the pieces look like.
    """
    points = np.array(path, dtype=np.float64)  # (N, 2)
    ahead = np.diff(points, axis=0)
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    tangents = np.vstack([ahead[:1], ahead[:-1] + ahead[1:], ahead[-1:]])
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    rings = []
    for (x, z), (along_x, along_z), section in zip(points, tangents, sections, strict=True):
        # With y as the second axis of the section, its first is y x tangent.
        first = np.array([along_z, 0.0, -along_x])
        rings.append(np.array([x, 0.0, z]) + section[:, :1] * first + section[:, 1:] * np.array([0.0, 1.0, 0.0]))
    return [Solid(rings=np.stack(pair), side=finish, ends=finish, pose=np.eye(4)) for pair in pairwise(rings)]


def arc(radius: float, start_deg: float, stop_deg: float, joints: int) -> list[tuple[float, float]]:
    """Points on a circle around the origin, as a path for :func:`sweep`."""
    angles = np.radians(np.linspace(start_deg, stop_deg, joints))
    return [(float(radius * math.cos(a)), float(radius * math.sin(a))) for a in angles]
