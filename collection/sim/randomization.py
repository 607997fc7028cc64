"""What may differ between scenes beside the objects: explicit values, drawn from the attempt's own seed and recorded.

Each kind is off unless asked for. Kinds draw from streams of their own: switching one on changes neither the objects
nor what the others draw.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from handsight.collection.depth_noise import DepthNoise
from handsight.collection.sim.camera import Light
from handsight.collection.sim.config import RANDOMIZED
from handsight.collection.sim.table_look import TableLook


@dataclass(frozen=True, slots=True, kw_only=True)
class LampPlace:
    """Where the lamp stands, and how much it gives."""

    azimuth_rad: float
    elevation_rad: float
    ambient: float
    """Brightness of what the lamp does not reach, as a share."""
    diffuse: float
    """What a surface that faces the lamp adds to it."""

    @classmethod
    def draw(cls, rng: np.random.Generator) -> LampPlace:
        """Any side, from low to overhead, from dim to glaring."""
        return cls(
            azimuth_rad=float(rng.uniform(-math.pi, math.pi)),
            elevation_rad=float(rng.uniform(math.radians(25), math.radians(85))),
            ambient=float(rng.uniform(0.35, 0.75)),
            diffuse=float(rng.uniform(0.15, 0.5)),
        )

    def light(self) -> Light:
        """As the renderer wants it."""
        flat = math.cos(self.elevation_rad)
        direction = (
            flat * math.cos(self.azimuth_rad),
            flat * math.sin(self.azimuth_rad),
            math.sin(self.elevation_rad),
        )
        return Light(direction=direction, ambient=self.ambient, diffuse=self.diffuse)


@dataclass(frozen=True, slots=True, kw_only=True)
class Friction:
    """Lateral friction coefficients; Bullet multiplies those of two bodies in contact."""

    table: float
    objects: float
    """Replaces what the objects' models say."""

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Friction:
        """From smooth plastic on a varnished table to rubber on cloth."""
        return cls(table=float(rng.uniform(0.4, 1.0)), objects=float(rng.uniform(0.5, 1.2)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Tint:
    """Factors on the colour of one object, or on its texture."""

    red: float
    green: float
    blue: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Tint:
        """Darker and of another hue, never brighter: white may not overflow."""
        red, green, blue = rng.uniform(0.35, 1.0, size=3)
        return cls(red=float(red), green=float(green), blue=float(blue))


@dataclass(frozen=True, slots=True, kw_only=True)
class Randomization:
    """The values of one attempt; None, or no tints, where a kind is off."""

    table: TableLook | None = None
    light: LampPlace | None = None
    friction: Friction | None = None
    depth_noise: DepthNoise | None = None
    tints: tuple[Tint, ...] = ()
    """One for each object of the scene."""

    @classmethod
    def draw(cls, kinds: Iterable[str], objects: int, rng: np.random.Generator) -> Randomization:
        """Draw what ``kinds`` names for a scene of so many objects."""
        # One stream for each kind there is, on or off, and all of them drawn before any is used.
        streams = dict(zip(RANDOMIZED, rng.spawn(len(RANDOMIZED)), strict=True))
        on = set(kinds)
        return cls(
            table=TableLook.draw(streams["table"]) if "table" in on else None,
            light=LampPlace.draw(streams["light"]) if "light" in on else None,
            friction=Friction.draw(streams["friction"]) if "friction" in on else None,
            depth_noise=DepthNoise.draw(streams["depth-noise"]) if "depth-noise" in on else None,
            tints=tuple(Tint.draw(streams["colour"]) for _ in range(objects)) if "colour" in on else (),
        )

    def values(self) -> NDArray[np.float64]:
        """All values in the order of :func:`condition_names`. Shape (K,)."""
        parts = [part for part in (self.table, self.light, *self.tints, self.friction, self.depth_noise) if part]
        return np.array([getattr(part, field.name) for part in parts for field in fields(part)], dtype=np.float64)


_PARTS: dict[str, type[TableLook | LampPlace | Tint | Friction | DepthNoise]] = {
    "table": TableLook,
    "light": LampPlace,
    "colour": Tint,
    "friction": Friction,
    "depth-noise": DepthNoise,
}


def condition_names(kinds: Iterable[str], objects: int) -> tuple[str, ...]:
    """What the values of :meth:`Randomization.values` are called, such as ``light_ambient`` or ``colour_red_0``."""
    on = set(kinds)
    names = []
    for kind in RANDOMIZED:
        if kind in on:
            ends = [f"_{index}" for index in range(objects)] if kind == "colour" else [""]
            prefix = kind.replace("-", "_")
            names += [f"{prefix}_{field.name}{end}" for end in ends for field in fields(_PARTS[kind])]
    return tuple(names)
