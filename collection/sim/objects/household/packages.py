"""Cans, bottles and cartons with printed labels. Lengths are in millimetres."""

from __future__ import annotations

import numpy as np

from handsight.collection.sim.objects.household import finishes as paint
from handsight.collection.sim.objects.household.solids import Array, Solid, box, disc, lathe, loft, prism, rectangle

ROUND = 16
"""Facets of a round can: enough to look round, few enough to come to rest instead of rolling away."""

_INSET_MM = 2.0
"""How much narrower the smaller of two boxes in line is: lying on its side, only the larger one makes contacts."""


def soup_can(rng: np.random.Generator) -> list[Solid]:
    """A paper-labelled can with rims of bare metal."""
    label = paint.labelled(paint.RED, paint.WHITE, "SOUP", paint.RED, faces=2)
    lid = paint.speckled(paint.STEEL, rng)
    body = lathe([(4.0, 32.0), (97.0, 32.0)], ROUND, label)
    rims = [lathe([(z, 33.0), (z + 4.0, 33.0)], ROUND, lid) for z in (0.0, 97.0)]
    return [body, *rims]


def drink_can(rng: np.random.Generator) -> list[Solid]:
    """A slim beverage can with a tapered neck."""
    print_ = paint.labelled(paint.BLUE, (214, 222, 236), "COLA", paint.BLUE, faces=2)
    metal = paint.speckled(paint.STEEL, rng)
    return [
        lathe([(5.0, 26.5), (122.0, 26.5)], ROUND, print_),
        lathe([(122.0, 26.5), (135.0, 23.0)], ROUND, metal),
        lathe([(0.0, 21.0), (5.0, 26.5)], ROUND, metal),
    ]


def mustard_bottle(rng: np.random.Generator) -> list[Solid]:
    """An oval squeeze bottle with sloping shoulders and a pointed cap."""
    skin = paint.speckled(paint.YELLOW, rng, 6)
    label = paint.labelled(paint.YELLOW, paint.RED, "MUSTARD", size=(64, 40), faces=2)
    cap = paint.plain((226, 160, 20))
    return [
        loft([(0.0, disc(14, 38, 23)), (8.0, disc(14, 42.5, 25)), (20.0, disc(14, 42.5, 25))], skin),
        loft([(20.0, disc(14, 42.5, 25)), (105.0, disc(14, 42.5, 25))], label, skin),
        loft([(105.0, disc(14, 42.5, 25)), (145.0, disc(14, 16, 14))], skin),
        lathe([(145.0, 14.0), (158.0, 13.0)], 12, cap),
        lathe([(158.0, 9.0), (175.0, 4.0)], 8, cap),
    ]


def water_bottle(rng: np.random.Generator) -> list[Solid]:
    """A slim drinking bottle with a waist and a screw cap."""
    pet, cap = paint.speckled((150, 196, 220), rng, 8), paint.plain(paint.BLUE)
    label = paint.labelled(paint.WHITE, paint.BLUE, "AQUA", size=(64, 32), faces=2)
    return [
        lathe([(0.0, 24.0), (6.0, 28.0), (54.0, 28.0)], 14, pet),
        lathe([(54.0, 26.0), (100.0, 26.0)], 14, label, pet),
        lathe([(100.0, 28.0), (118.0, 28.0), (158.0, 12.5)], 14, pet),
        lathe([(158.0, 11.5), (167.0, 11.5)], 10, pet),
        lathe([(167.0, 14.0), (184.0, 14.0)], 12, cap),
    ]


def shampoo_bottle(rng: np.random.Generator) -> list[Solid]:
    """A flat bottle that widens upwards, standing on a broad flip cap."""
    print_ = paint.labelled(paint.PINK, paint.WHITE, "SHINE", (150, 50, 90), size=(64, 56), faces=2)
    cap = paint.speckled((120, 40, 80), rng, 6)
    low, mid = rectangle(44, 26, 8), rectangle(62, 33, 10)
    return [
        prism(low, 24.0, cap),
        loft([(24.0, low), (52.0, mid), (130.0, mid), (146.0, rectangle(48, 19, 6))], print_, cap),
    ]


def fish_tin(rng: np.random.Generator) -> list[Solid]:
    """A flat rounded tin with a printed lid, a rim and a ring pull."""
    metal = paint.speckled(paint.STEEL, rng)
    lid = paint.labelled((36, 60, 130), paint.YELLOW, "FISH", (36, 60, 130))
    return [
        prism(rectangle(100, 56, 18), 20.0, metal).at(z=2),
        *(prism(rectangle(104, 60, 18), 3.0, metal, lid).at(z=z) for z in (0.0, 21.0)),
        box(16, 9, 2, metal).at(x=38, z=24),
    ]


def _carton(
    x: float, y: float, z: float, front: paint.Finish, edge: paint.Finish, ends: paint.Finish | None = None
) -> list[Solid]:
    """A carton with printed faces and a band of another colour around its foot."""
    foot = 0.14 * z
    return [box(x - _INSET_MM, y - _INSET_MM, foot, edge), box(x, y, z - foot, front, ends or edge).at(z=foot)]


def toothpaste_box(rng: np.random.Generator) -> list[Solid]:
    """A long narrow carton on its side, its word along it."""
    front = paint.labelled(paint.WHITE, paint.BLUE, "MINT", size=(64, 24), faces=4, lengthwise=True)
    ends = paint.speckled(paint.RED, rng, 6)
    flap = box(36 - _INSET_MM, 48 - _INSET_MM, 20, ends)
    pieces = [prism(rectangle(36, 48), 150.0, front, ends).at(z=20), flap]
    return [piece.turned("y", 90).at(x=-85) for piece in pieces]


def foam_brick(rng: np.random.Generator) -> list[Solid]:
    """A block of two kinds of foam, one glued onto the other."""
    soft, rough = paint.speckled((222, 120, 96), rng, 24), paint.speckled((70, 120, 84), rng, 24)
    return [box(75, 50, 38, soft), box(75 - _INSET_MM, 50 - _INSET_MM, 12, rough).at(z=38)]


def juice_box(rng: np.random.Generator) -> list[Solid]:
    """A drink pack with folded ears and a bent straw."""
    front = paint.labelled(paint.ORANGE, paint.GREEN, "JUICE")
    foil, straw = paint.speckled(paint.CREAM, rng, 5), paint.plain(paint.RED)
    return [
        *_carton(47, 37, 115, front, paint.plain(paint.GREEN), foil),
        *(
            loft([(0.0, rectangle(3, 22)), (12.0, rectangle(3, 6))], foil).turned("x", 180).at(x=x, z=115)
            for x in (-24, 24)
        ),
        lathe([(112.0, 3.0), (132.0, 3.0)], 6, straw).at(x=12),
        lathe([(0.0, 3.0), (18.0, 3.0)], 6, straw).turned("y", 60).at(x=10.5, z=131),
    ]


def spray_bottle(rng: np.random.Generator) -> list[Solid]:
    """A cleaner bottle with a trigger head that points forwards."""
    fluid = paint.labelled((90, 180, 210), paint.WHITE, "CLEAN", (20, 90, 140), faces=2)
    shoulder, red, white = paint.plain((90, 180, 210)), paint.plain(paint.RED), paint.speckled(paint.WHITE, rng, 4)
    return [
        prism(rectangle(64, 40, 10), 96.0, fluid),
        loft([(96.0, rectangle(64, 40, 10)), (128.0, rectangle(24, 24, 7))], shoulder),
        lathe([(128.0, 14.0), (146.0, 14.0)], 10, white),
        box(62, 18, 22, red).at(x=14, z=146),
        box(10, 10, 8, white).at(x=48, z=154),
        box(6, 10, 36, white).turned("y", -22).at(x=34, z=112),
    ]


def chocolate_prism(rng: np.random.Generator) -> list[Solid]:
    """A three-sided bar with notched ends."""
    print_ = paint.labelled(paint.CREAM, paint.RED, "CHOC", size=(64, 28), faces=3, lengthwise=True)
    ends = paint.speckled(paint.RED, rng, 6)
    long = prism(_triangle(24.0), 150.0, print_, ends).at(z=8)
    caps = [prism(_triangle(21.0), 8.0, ends).at(z=z) for z in (0.0, 158.0)]
    return [piece.turned("y", 90) for piece in (long, *caps)]


def _triangle(radius: float) -> Array:
    return disc(3, radius)


def pepper_mill(rng: np.random.Generator) -> list[Solid]:
    """A turned wooden mill: foot, waist, belly and knob."""
    wood, dark = paint.wooden(rng, (120, 72, 40)), paint.wooden(rng, (70, 40, 26))
    return [
        lathe([(0.0, 27.0), (14.0, 27.0)], 12, dark),
        lathe([(14.0, 25.0), (62.0, 16.0)], 12, wood),
        lathe([(62.0, 16.0), (96.0, 24.0), (104.0, 24.0)], 12, wood),
        lathe([(104.0, 20.0), (118.0, 26.0), (134.0, 18.0)], 12, dark),
        lathe([(134.0, 7.0), (144.0, 9.0), (150.0, 5.0)], 8, paint.speckled(paint.STEEL, rng)),
    ]
