"""The household objects: 30 for training, 10 novel ones for testing, with where their size and mass come from.

"YCB list" is the table of objects in Calli et al., "Benchmarking in Manipulation Research", IEEE Robotics & Automation
Magazine 22(3), 2015: name of the entry, dimensions in millimetres, mass. Shapes follow those dimensions but are not
the scanned meshes. "Typical" figures are those of common products, rounded, and cite no catalogue.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from handsight.collection.sim.objects.household import packages, tools, toys, vessels
from handsight.collection.sim.objects.household.solids import Solid

GENERATOR_SEED = 20_180_517
GENERATOR_VERSION = 1
"""Raise it when a change to the generators changes an object, so that recorded datasets stay attributable."""

STEEL, PLASTIC, CARD, WOOD, GLAZE, RUBBER = 0.7, 0.8, 0.8, 0.8, 0.7, 1.0
"""Lateral friction of an object's surface; PyBullet multiplies it with that of table (0.7) or fingers (1.8)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HouseholdObject:
    """One entry of the table."""

    name: str
    build: Callable[[np.random.Generator], list[Solid]]
    mass_kg: float
    friction: float
    source: str
    """Where size and mass come from."""


def _entry(
    build: Callable[[np.random.Generator], list[Solid]], mass_g: float, friction: float, source: str
) -> HouseholdObject:
    return HouseholdObject(
        name=build.__name__.replace("_", "-"), build=build, mass_kg=mass_g / 1000, friction=friction, source=source
    )


TRAIN = (
    _entry(vessels.mug, 118, GLAZE, "YCB list: mug, 80x82, 118 g"),
    _entry(vessels.espresso_cup, 105, GLAZE, "typical espresso cup, 66x58"),
    _entry(vessels.tumbler, 28, PLASTIC, "typical small plastic tumbler, 54x80"),
    _entry(vessels.bowl, 110, GLAZE, "typical dip bowl, 96x46"),
    _entry(packages.soup_can, 349, STEEL, "YCB list: tomato soup can, 66x101, 349 g"),
    _entry(packages.drink_can, 265, STEEL, "typical full 0.25 l slim can, 53x135"),
    _entry(packages.mustard_bottle, 603, PLASTIC, "YCB list: mustard bottle, 50x85x175, 603 g"),
    _entry(packages.water_bottle, 350, PLASTIC, "typical full 0.33 l bottle, 56x184"),
    _entry(packages.shampoo_bottle, 190, PLASTIC, "typical full travel bottle, 33x62x146"),
    _entry(packages.fish_tin, 160, STEEL, "typical tin of sardines, 104x60x24"),
    _entry(packages.toothpaste_box, 125, CARD, "typical full toothpaste carton, 48x36x170"),
    _entry(packages.foam_brick, 28, RUBBER, "YCB list: foam brick, 50x75x50, 28 g"),
    _entry(packages.juice_box, 215, CARD, "typical full 0.2 l drink pack, 47x37x115"),
    _entry(tools.screwdriver, 97, PLASTIC, "YCB list: Phillips screwdriver, 31x215, 97 g"),
    _entry(tools.hammer, 450, STEEL, "typical light machinist's hammer, 235 mm"),
    _entry(tools.spanner, 120, STEEL, "typical 17 mm combination spanner, shortened to 165 mm"),
    _entry(tools.pliers, 210, RUBBER, "typical 180 mm combination pliers"),
    _entry(tools.nail_brush, 68, WOOD, "typical wooden nail brush, 92x40x40"),
    _entry(tools.dish_brush, 62, PLASTIC, "typical dish brush, shortened to 190 mm"),
    _entry(tools.glue_stick, 36, PLASTIC, "typical glue stick, 31x98"),
    _entry(tools.toothbrush, 18, PLASTIC, "typical toothbrush, 190 mm"),
    _entry(tools.paint_brush, 62, WOOD, "typical 38 mm flat brush, shortened to 175 mm"),
    _entry(tools.remote_control, 85, PLASTIC, "typical slim remote control with batteries, 154x38x20"),
    _entry(tools.marker, 15.8, PLASTIC, "YCB list: large marker, 18x121, 15.8 g"),
    _entry(tools.tape_roll, 90, CARD, "typical part roll of packing tape, 88x40"),
    _entry(toys.toy_car, 88, PLASTIC, "typical plastic toy car, 100x50x46"),
    _entry(toys.toy_duck, 48, RUBBER, "typical bath duck, 100x44x69"),
    _entry(toys.toy_brick, 24, PLASTIC, "2x4 brick of the double size for small children, 64x32x24"),
    _entry(toys.banana, 66, RUBBER, "YCB list: banana, 36x190, 66 g"),
    _entry(toys.spoon, 60, STEEL, "typical serving spoon, shortened to 195 mm"),
)

TEST = (
    _entry(vessels.milk_jug, 230, GLAZE, "typical ceramic creamer, 0.25 l"),
    _entry(vessels.wine_glass, 133, GLAZE, "YCB list: wine glass, 89x137, 133 g; bowl narrowed to 76 mm"),
    _entry(packages.spray_bottle, 310, PLASTIC, "typical half-full trigger sprayer, 64x40x168"),
    _entry(packages.chocolate_prism, 200, CARD, "typical three-sided chocolate bar, 200 g"),
    _entry(packages.pepper_mill, 180, WOOD, "typical turned pepper mill, 54x150"),
    _entry(tools.padlock, 220, STEEL, "typical 50 mm brass padlock"),
    _entry(tools.torch, 140, PLASTIC, "typical two-cell torch, 144 mm"),
    _entry(tools.stapler, 230, STEEL, "typical desk stapler, 140 mm"),
    _entry(toys.toy_plane, 120, WOOD, "typical wooden toy plane, 130x150"),
    _entry(toys.game_controller, 210, PLASTIC, "typical gamepad, 150x95"),
)


def rng_of(item: HouseholdObject) -> np.random.Generator:
    """The random stream of one object: its paint does not depend on the other objects."""
    return np.random.default_rng([GENERATOR_SEED, *item.name.encode()])
