"""Hollow things: mugs, cups, bowls, a jug, a glass. Their hollow is real, and jaws can close on the rim.

Lengths are in millimetres.
"""

from __future__ import annotations

import numpy as np

from handsight.collection.sim.objects.household import finishes as paint
from handsight.collection.sim.objects.household.solids import Solid, arc, disc, lathe, loft, rectangle, sweep, wall

_FOOT_MM = 2.5
"""How far the floor of a vessel stands out below its wall."""


def _vessel(
    outer: list[tuple[float, float]],
    *,
    thick: float,
    floor: float,
    segments: int,
    finish: paint.Finish,
    inside: paint.Finish,
) -> list[Solid]:
    """A floor and the wall around it; ``outer`` holds (height, radius) of the outside, its foot at height 0.

    The floor is a disc that ends inside the wall and alone touches the table: a wall on the table would make ten times
    as many contacts, and the solver's time goes with their number.
    """
    lowest, *others = outer
    inner = (lowest[1] - thick, outer[-1][1] - thick)
    pieces = wall([(_FOOT_MM, lowest[1]), *others], inner, segments, finish, inside)
    foot = inner[0] + 0.3 * thick
    return [*pieces, lathe([(0.0, foot), (floor, foot)], segments, inside)]


def mug(rng: np.random.Generator) -> list[Solid]:
    """A straight mug with a D-shaped handle."""
    glaze = paint.wrapped(_mug_print(rng))
    outer = [(0.0, 37.5), (4.0, 39.6), (82.0, 39.6)]
    handle = sweep([(37, 68), (62, 62), (62, 28), (37, 20)], [rectangle(6, 11)] * 4, paint.speckled(paint.BLUE, rng, 4))
    return [*_vessel(outer, thick=5, floor=7, segments=8, finish=glaze, inside=paint.plain(paint.WHITE)), *handle]


def _mug_print(rng: np.random.Generator) -> paint.Pixels:
    """Blue glaze with a white band of dots."""
    tile = np.empty((32, 64, 3), np.uint8)
    tile[:] = paint.BLUE
    tile[10:22] = paint.WHITE
    for left in range(2, 64, 8):
        tile[14:18, left : left + 4] = paint.RED if rng.integers(2) else paint.YELLOW
    return tile


def espresso_cup(rng: np.random.Generator) -> list[Solid]:
    """A small tapered cup with a round ear."""
    glaze = paint.speckled(paint.WHITE, rng, 6)
    outer = [(0.0, 20.0), (12.0, 28.0), (58.0, 33.0)]
    ear = [(29 + x, 36 + z) for x, z in arc(15, 75, -75, 4)]
    cup = _vessel(outer, thick=4.5, floor=6, segments=8, finish=glaze, inside=paint.speckled((226, 222, 212), rng, 4))
    return [*cup, *sweep(ear, [disc(4, 3.6, 5.6)] * 4, paint.plain(paint.ORANGE))]


def tumbler(rng: np.random.Generator) -> list[Solid]:
    """A ribbed plastic beaker without a handle."""
    ribs = paint.striped([paint.GREEN, (120, 200, 120)], 16)
    outer = [(0.0, 21.0), (80.0, 27.0)]
    return _vessel(outer, thick=3.5, floor=5, segments=10, finish=ribs, inside=paint.speckled(paint.GREEN, rng, 6))


def bowl(rng: np.random.Generator) -> list[Solid]:
    """A small bowl with a rounded outside."""
    glaze = paint.banded([paint.RED, paint.WHITE, paint.RED], [6, 3, 16])
    outer = [(0.0, 30.0), (18.0, 43.0), (46.0, 48.0)]
    inside = paint.speckled((214, 70, 60), rng, 5)
    return _vessel(outer, thick=5, floor=7, segments=10, finish=glaze, inside=inside)


def milk_jug(rng: np.random.Generator) -> list[Solid]:
    """A bellied jug with a spout and an angular handle."""
    glaze = paint.speckled(paint.CREAM, rng, 10)
    outer = [(0.0, 30.0), (34.0, 39.0), (86.0, 31.0)]
    spout = loft([(56.0, rectangle(6, 10) - [33, 0]), (90.0, rectangle(16, 20) - [37, 0])], glaze)
    handle = sweep([(29, 78), (58, 72), (36, 24)], [rectangle(8, 12)] * 3, paint.plain(paint.BLUE))
    jug = _vessel(outer, thick=5, floor=7, segments=8, finish=glaze, inside=paint.plain(paint.CREAM))
    return [*jug, spout, *handle]


def wine_glass(rng: np.random.Generator) -> list[Solid]:
    """A goblet on a stem."""
    glass, foot = paint.speckled((176, 206, 214), rng, 5), paint.plain((150, 180, 190))
    base = lathe([(0.0, 36.0), (2.0, 36.0), (7.0, 7.0)], 14, foot)
    stem = lathe([(7.0, 6.0), (66.0, 6.0)], 8, foot)
    cup = wall([(66.0, 22.0), (92.0, 38.0), (137.0, 34.0)], (14.0, 29.5), 8, glass, foot)
    floor = lathe([(64.0, 12.0), (74.0, 20.0)], 8, glass)
    return [*cup, floor, stem, base]
