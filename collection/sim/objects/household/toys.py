"""Toys, fruit and a spoon. Lengths are in millimetres."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from handsight.collection.sim.objects.household import finishes as paint
from handsight.collection.sim.objects.household.solids import (
    Solid,
    arc,
    box,
    disc,
    lathe,
    loft,
    prism,
    rectangle,
    rod,
    sweep,
)


def toy_car(rng: np.random.Generator) -> list[Solid]:
    """A saloon on four wheels."""
    body, glass = paint.speckled(paint.RED, rng, 6), paint.plain((120, 170, 200))
    wheel = paint.spotted(paint.BLACK, paint.STEEL)
    wheels = [
        prism(disc(10, 12), 9, paint.plain(paint.BLACK), wheel).turned("x", 90).at(x=x, y=y, z=12)
        for x in (-28, 28)
        for y in (-16, 25)
    ]
    return [
        prism(rectangle(96, 42, 6), 20, body).at(z=8),
        loft([(28.0, rectangle(58, 40, 4) - [6, 0]), (46.0, rectangle(36, 32, 4) - [8, 0])], glass, body),
        *wheels,
        box(4, 34, 6, paint.plain(paint.YELLOW)).at(x=48, z=16),
    ]


def toy_duck(rng: np.random.Generator) -> list[Solid]:
    """A bath duck: body, tail, head and bill."""
    yellow, orange = paint.speckled(paint.YELLOW, rng, 6), paint.plain(paint.ORANGE)
    eye = paint.plain(paint.BLACK)
    hull = [(0.0, disc(12, 26, 15)), (14.0, disc(12, 38, 22)), (30.0, disc(12, 36, 21)), (42.0, disc(12, 24, 13))]
    head = lathe([(0.0, 10.0), (9.0, 17.0), (20.0, 18.0), (31.0, 8.0)], 10, yellow)
    return [
        loft(hull, yellow),
        loft([(0.0, rectangle(18, 24)), (26.0, rectangle(6, 10))], yellow).turned("y", -50).at(x=-30, z=32),
        head.at(x=20, z=38),
        loft([(0.0, rectangle(9, 18)), (16.0, rectangle(5, 14))], orange).turned("y", 90).at(x=35, z=52),
        *(box(5, 3, 5, eye).at(x=30, y=y, z=57) for y in (-13, 13)),
    ]


def toy_brick(rng: np.random.Generator) -> list[Solid]:
    """A two-by-four building brick with studs."""
    red = paint.speckled(paint.RED, rng, 4)
    top = paint.plain((226, 64, 56))
    studs = [lathe([(0.0, 4.8), (4.5, 4.8)], 6, top).at(x=x, y=y, z=19) for x in (-24, -8, 8, 24) for y in (-8, 8)]
    return [box(63.8, 31.8, 19.0, red), *studs]


def toy_plane(rng: np.random.Generator) -> list[Solid]:
    """A wooden aeroplane with a propeller."""
    wood, blue = paint.wooden(rng), paint.speckled(paint.BLUE, rng, 6)
    fuselage = loft([(0.0, rectangle(12, 10, 3)), (70.0, rectangle(26, 24, 7)), (112.0, rectangle(24, 22, 7))], wood)
    return [
        fuselage.turned("y", 90).at(x=-70, z=20),
        prism(rectangle(34, 150, 10), 7, blue).at(x=8, z=17),
        prism(rectangle(20, 58, 6), 6, blue).at(x=-60, z=18),
        loft([(0.0, rectangle(26, 6)), (30.0, rectangle(12, 5))], blue).at(x=-58, z=22),
        rod(12, 7, 8, paint.plain(paint.YELLOW)).at(x=47, z=20),
        box(4, 56, 9, paint.plain(paint.RED)).turned("x", 35).at(x=54, z=17),
        rod(10, 9, 8, paint.plain(paint.BLACK)).turned("z", 90).at(x=22, y=14, z=9),
        rod(10, 9, 8, paint.plain(paint.BLACK)).turned("z", 90).at(x=22, y=-14, z=9),
    ]


def game_controller(rng: np.random.Generator) -> list[Solid]:
    """A gamepad: body, two grips, two sticks and a cluster of buttons."""
    case, black = paint.speckled((226, 226, 230), rng, 4), paint.plain(paint.BLACK)
    grip = loft([(0.0, rectangle(34, 30, 9)), (60.0, rectangle(22, 22, 6))], case)
    pad = paint.keyed((200, 200, 206), [paint.RED, paint.GREEN, paint.BLUE, paint.YELLOW], 2, 2)
    return [
        prism(rectangle(104, 56, 16), 28, case),
        *(grip.turned("x", 90).turned("z", tilt).at(x=x, y=-8, z=14) for x, tilt in ((-46, -16), (46, 16))),
        *(lathe([(28.0, 6.0), (38.0, 9.0)], 8, black).at(x=x, y=-14) for x in (-22, 22)),
        box(24, 24, 4, pad).at(x=36, y=10, z=28),
        *(box(20, 7, 4, black).turned("z", tilt).at(x=-36, y=10, z=28) for tilt in (0, 90)),
    ]


def banana(rng: np.random.Generator) -> list[Solid]:
    """A bent fruit lying on its side, brown at both ends."""
    peel, tip = paint.speckled((238, 208, 60), rng, 8), paint.plain((96, 72, 30))
    thick = [8.0, 15.0, 18.0, 18.0, 15.0, 8.0]
    path = [(x, z - 118) for x, z in arc(118, 127, 53, 6)]
    pieces = sweep(path, [disc(8, r) for r in thick], peel)
    stalk = sweep([path[0], (path[0][0] - 14, path[0][1] - 13)], [disc(8, 7), disc(8, 5)], tip)
    blossom = sweep([path[-1], (path[-1][0] + 5, path[-1][1] - 5)], [disc(8, 7), disc(8, 4)], tip)
    return [piece.turned("x", 90) for piece in (*pieces, *stalk, *blossom)]


def spoon(rng: np.random.Generator) -> list[Solid]:
    """A serving spoon: a hollow bowl on an arched handle."""
    steel, grip = paint.speckled((190, 194, 200), rng, 8), paint.speckled(paint.BLACK, rng, 6)
    rim = sweep([(0, 0), (14, 14), (46, 15), (64, 0), (46, -15), (14, -14), (0, 0)], [rectangle(4, 12)] * 7, steel)
    # The path lies in the xz plane: a quarter turn lays it on the table.
    bowl = [piece.turned("x", 90).at(z=8) for piece in rim]
    floor = prism(np.array([(62, 0), (46, 14), (14, 13), (2, 0), (14, -13), (46, -14)], np.float64), 4, steel)
    handle = sweep(
        [(2, 8), (-35, 18), (-80, 17), (-130, 9)],
        [rectangle(6, 9), rectangle(6, 10), rectangle(9, 15), rectangle(9, 18)],
        steel,
    )
    return [*bowl, floor, *handle[:1], *(replace(piece, side=grip, ends=grip) for piece in handle[1:])]
