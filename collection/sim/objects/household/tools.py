"""Hand tools, brushes and desk things. They lie flat along x. Lengths are in millimetres."""

from __future__ import annotations

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
    wall,
)

STEEL_TO_PLASTIC = 7.0
"""How many times denser steel is than plastic or hard wood."""


def screwdriver(rng: np.random.Generator) -> list[Solid]:
    """A fluted handle, a collar and a blade."""
    grip = paint.striped([paint.RED, paint.RED, paint.BLACK], 5)
    steel = paint.speckled(paint.STEEL, rng)
    handle = lathe([(0.0, 12.0), (8.0, 15.5), (80.0, 15.5), (96.0, 10.0)], 10, grip, paint.plain(paint.BLACK))
    return [
        handle.turned("y", 90).at(x=-108),
        rod(12, 10, 10, paint.plain(paint.YELLOW)).at(x=-7),
        rod(96, 4, 8, steel).at(x=46).weighing(STEEL_TO_PLASTIC),
        loft([(0.0, disc(8, 4)), (14.0, disc(8, 1.5))], steel).turned("y", 90).at(x=93).weighing(STEEL_TO_PLASTIC),
    ]


def hammer(rng: np.random.Generator) -> list[Solid]:
    """A wooden handle in a steel head with a round face and a wedge."""
    steel, wood = paint.speckled((92, 96, 104), rng), paint.wooden(rng)
    handle = loft(
        [(0.0, disc(10, 15, 11)), (110.0, disc(10, 12, 9.5)), (215.0, disc(10, 10, 8))], wood, paint.plain(paint.RED)
    )
    head = box(34, 24, 26, steel).at(z=-13)
    face = lathe([(0.0, 12.0), (30.0, 14.0)], 12, steel).turned("x", 90).at(y=-10)
    wedge = loft([(0.0, rectangle(28, 22)), (42.0, rectangle(28, 4))], steel).turned("x", -90).at(y=10)
    heavy = [piece.at(x=215).weighing(STEEL_TO_PLASTIC) for piece in (head, face, wedge)]
    return [piece.at(x=-110) for piece in (handle.turned("y", 90), *heavy)]


def spanner(rng: np.random.Generator) -> list[Solid]:
    """An open jaw on one end, a ring on the other."""
    steel = paint.speckled(paint.STEEL, rng, 18)
    ring = wall([(0.0, 14.0), (12.0, 14.0)], (8.0, 8.0), 6, steel)
    bar = box(110, 15, 9, steel).at(z=1.5)
    collar = prism(rectangle(16, 30, 6), 12, steel).at(x=62)
    jaws = [box(22, 9, 12, steel).turned("z", tilt).at(x=76, y=y) for y, tilt in ((12, 8), (-12, -8))]
    return [*(piece.at(x=-66) for piece in ring), bar, collar, *jaws]


def pliers(rng: np.random.Generator) -> list[Solid]:
    """Two bent, sleeved handles, a pivot and tapered jaws."""
    sleeve, steel = paint.speckled(paint.BLUE, rng, 8), paint.speckled((110, 114, 120), rng)
    arm = sweep(
        [(0, 4), (-40, 20), (-75, 25), (-110, 22)],
        [rectangle(12, 14), rectangle(12, 14), rectangle(13, 15), rectangle(9, 12)],
        sleeve,
    )
    upper = [piece.turned("x", 90).at(z=9) for piece in arm]
    lower = [piece.turned("x", -90).at(z=9) for piece in arm]
    pivot = lathe([(0.0, 15.0), (18.0, 15.0)], 12, steel, paint.spotted((110, 114, 120), paint.BLACK))
    jaw = loft([(0.0, rectangle(16, 22)), (52.0, rectangle(8, 8))], steel).turned("y", 90).at(x=10, z=9)
    return [*upper, *lower, pivot.weighing(STEEL_TO_PLASTIC), jaw.weighing(STEEL_TO_PLASTIC)]


def nail_brush(rng: np.random.Generator) -> list[Solid]:
    """A block of bristles under a wooden back with a raised grip."""
    wood = paint.wooden(rng)
    return [
        box(82, 32, 16, paint.bristled(paint.CREAM, rng)),
        prism(rectangle(92, 40, 10), 12, wood).at(z=16),
        loft([(28.0, rectangle(60, 22, 6)), (40.0, rectangle(50, 14, 4))], wood),
    ]


def dish_brush(rng: np.random.Generator) -> list[Solid]:
    """A round head of bristles on a long bent handle."""
    white, tuft = paint.speckled(paint.WHITE, rng, 4), paint.bristled(paint.GREEN, rng)
    handle = sweep([(10, 24), (-60, 30), (-150, 22)], [rectangle(9, 16), rectangle(10, 18), rectangle(12, 24)], white)
    return [
        lathe([(0.0, 25.0), (20.0, 21.0)], 12, tuft),
        lathe([(20.0, 23.0), (32.0, 17.0)], 12, white),
        *handle,
        box(16, 24, 12, paint.plain(paint.GREEN)).at(x=-156, z=16),
    ]


def toothbrush(rng: np.random.Generator) -> list[Solid]:
    """A bent handle with a soft grip and a small head of bristles."""
    blue, grip = paint.speckled((60, 150, 200), rng, 5), paint.speckled(paint.WHITE, rng, 4)
    handle = sweep(
        [(-95, 7), (-20, 9), (30, 6), (95, 7)],
        [rectangle(12, 13, 3), rectangle(13, 15, 3), rectangle(7, 8, 2), rectangle(7, 12, 2)],
        blue,
    )
    pad = box(60, 10, 4, grip).turned("y", -1.5).at(x=-55, z=12.5)
    return [*handle, pad, box(28, 11, 9, paint.bristled(paint.WHITE, rng)).at(x=80, z=9)]


def glue_stick(rng: np.random.Generator) -> list[Solid]:
    """A short thick tube with a cap and a knurled wheel."""
    print_ = paint.labelled(paint.YELLOW, paint.RED, "GLUE", size=(56, 22), faces=3, lengthwise=True)
    tube, cap, wheel = (
        rod(62, 15, 12, print_),
        rod(26, 15.6, 12, paint.speckled(paint.RED, rng, 5)),
        rod(10, 14, 10, paint.plain(paint.BLACK)),
    )
    return [tube, cap.at(x=44), wheel.at(x=-36)]


def paint_brush(rng: np.random.Generator) -> list[Solid]:
    """A flat brush: shaped handle, metal ferrule, bristles."""
    wood, ferrule = paint.wooden(rng, (206, 60, 44)), paint.speckled(paint.STEEL, rng)
    handle = loft([(0.0, rectangle(12, 14, 3)), (60.0, rectangle(14, 24, 4)), (95.0, rectangle(12, 18, 3))], wood)
    return [
        handle.turned("y", 90).at(x=-115, z=8),
        loft([(0.0, rectangle(14, 26)), (30.0, rectangle(16, 38))], ferrule).turned("y", 90).at(x=-20, z=8),
        loft([(0.0, rectangle(15, 37)), (50.0, rectangle(8, 35))], paint.bristled((226, 206, 160), rng))
        .turned("y", 90)
        .at(x=10, z=8),
    ]


def remote_control(rng: np.random.Generator) -> list[Solid]:
    """A slab with rows of coloured keys and a sloping nose."""
    case = paint.speckled(paint.BLACK, rng, 5)
    keys = paint.keyed((44, 44, 50), [paint.WHITE, paint.WHITE, paint.RED, paint.WHITE, paint.BLUE, paint.GREEN], 9, 3)
    # The upper end of a prism along z shows the tile with its rows along y, as the keys run.
    body = prism(rectangle(38, 140, 5), 18, case)
    keypad = prism(rectangle(31, 120, 4), 2, keys).at(z=18)
    nose = loft([(0.0, rectangle(33, 18)), (14.0, rectangle(29, 14))], case).turned("x", -90).at(y=70, z=9)
    return [piece.turned("z", 90) for piece in (body, keypad, nose)]


def marker(rng: np.random.Generator) -> list[Solid]:
    """A thick felt pen with a cap."""
    barrel = paint.labelled(paint.WHITE, (210, 210, 206), "MARK", paint.RED, size=(40, 20), faces=3, lengthwise=True)
    red = paint.speckled(paint.RED, rng, 4)
    return [
        rod(76, 9, 10, barrel).at(x=-22),
        rod(36, 9.6, 10, red).at(x=34),
        lathe([(0.0, 7.0), (9.0, 5.0)], 10, red).turned("y", 90).at(x=52),
    ]


def tape_roll(rng: np.random.Generator) -> list[Solid]:
    """A ring of brown tape."""
    tape = paint.banded([(160, 110, 60), (196, 146, 88), (160, 110, 60)], [3, 18, 3])
    core = paint.speckled((206, 176, 130), rng, 8)
    ring = wall([(0.0, 44.0), (40.0, 44.0)], (37.0, 37.0), 11, tape, core)
    loose_end = box(2, 16, 40, paint.speckled(paint.CREAM, rng, 5)).at(x=43.5, y=6)
    return [*ring, loose_end]


def padlock(rng: np.random.Generator) -> list[Solid]:
    """A brass body under a round shackle."""
    brass, steel = paint.speckled((206, 164, 70), rng), paint.speckled(paint.STEEL, rng)
    body = prism(rectangle(50, 24, 5), 46, brass, paint.spotted((206, 164, 70), paint.BLACK, 3))
    path = [(15.0, 44.0), *((x, 62.0 + z) for x, z in arc(15.0, 0, 180, 5)), (-15.0, 44.0)]
    return [piece.turned("x", 90) for piece in (body, *sweep(path, [disc(6, 4.6)] * len(path), steel))]


def torch(rng: np.random.Generator) -> list[Solid]:
    """A knurled torch with a flared head, a lens and a switch."""
    knurl, rim = paint.striped([paint.BLACK, (64, 64, 70)], 8), paint.speckled((60, 62, 68), rng, 6)
    lens = paint.spotted((60, 62, 68), (250, 244, 190), 9)
    parts = [
        lathe([(0.0, 12.0), (6.0, 14.0), (104.0, 14.0)], 12, knurl, rim),
        lathe([(104.0, 14.0), (126.0, 23.0), (144.0, 23.0)], 12, rim, lens),
        box(8, 12, 22, paint.plain(paint.ORANGE)).at(x=12, z=70),
    ]
    return [piece.turned("y", 90).at(x=-72) for piece in parts]


def stapler(rng: np.random.Generator) -> list[Solid]:
    """A base, a hinge and an arm that stands open."""
    red, steel = paint.speckled(paint.RED, rng, 6), paint.speckled(paint.STEEL, rng)
    arm = [prism(rectangle(128, 26, 6), 14, red), box(122, 18, 8, steel).at(z=-8)]
    return [
        prism(rectangle(140, 36, 8), 9, paint.plain(paint.BLACK)),
        box(24, 30, 30, red).at(x=-54, z=9),
        *(piece.turned("y", -9).at(x=4, z=32) for piece in arm),
        box(16, 14, 3, steel).at(x=54, z=9),
    ]
