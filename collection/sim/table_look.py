"""Tables that differ from attempt to attempt: boards, stone, cloth and stripes in any colour."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from handsight.collection.sim.table import TABLE_HALF_SIZE_M, TableTop

TEXTURE_PX = 512
CELL_PX = 16
"""Side of the smallest feature of a pattern: 5 cm on the table."""
PATTERNS = ("boards", "stone", "cloth", "stripes")


@dataclass(frozen=True, slots=True, kw_only=True)
class TableLook:
    """What decides the texture of a table; every field is a number, so that it can be recorded and queried."""

    pattern: int
    """Index into ``PATTERNS``."""
    red: float
    green: float
    blue: float
    """Mean colour, 0 to 255."""
    contrast: float
    """Standard deviation of the brightness, as a share of the mean."""
    seed: int
    """Of the irregularities."""

    @classmethod
    def draw(cls, rng: np.random.Generator) -> TableLook:
        """A random table, from dark to light and from grey to colourful."""
        red, green, blue = rng.uniform(40, 230) * rng.uniform(0.6, 1.1, size=3)
        return cls(
            pattern=int(rng.integers(len(PATTERNS))),
            red=float(red),
            green=float(green),
            blue=float(blue),
            contrast=float(rng.uniform(0.02, 0.15)),
            seed=int(rng.integers(2**32)),
        )

    def table_top(self) -> TableTop:
        """The table that looks like this."""
        relief = _PAINTERS[PATTERNS[self.pattern]](np.random.default_rng(self.seed))  # (P, P), mean 0, deviation 1
        shade = 1.0 + self.contrast * relief
        colour = np.array((self.red, self.green, self.blue), dtype=np.float32)
        texture = np.clip(shade[:, :, None] * colour, 0, 255).astype(np.uint8)
        return TableTop(texture, size_m=2 * TABLE_HALF_SIZE_M)


def _noise(rng: np.random.Generator, rows: int, columns: int) -> NDArray[np.float32]:
    """Smooth noise with so many features across. Shape (P, P)."""
    coarse = rng.normal(size=(rows, columns)).astype(np.float32)
    return np.asarray(cv2.resize(coarse, (TEXTURE_PX, TEXTURE_PX), interpolation=cv2.INTER_CUBIC), dtype=np.float32)


def _boards(rng: np.random.Generator) -> NDArray[np.float32]:
    boards = rng.normal(size=TEXTURE_PX // (2 * CELL_PX)).astype(np.float32).repeat(2 * CELL_PX)
    return _normalised(_noise(rng, TEXTURE_PX // 4, TEXTURE_PX // 64) + boards[:, None])


def _stone(rng: np.random.Generator) -> NDArray[np.float32]:
    return _normalised(_noise(rng, TEXTURE_PX // 4, TEXTURE_PX // 4) + _noise(rng, 16, 16))


def _cloth(rng: np.random.Generator) -> NDArray[np.float32]:
    cells = np.arange(TEXTURE_PX) // CELL_PX % 2
    checks = (cells[:, None] ^ cells[None, :]).astype(np.float32)
    return _normalised(checks + 0.2 * _noise(rng, TEXTURE_PX // 4, TEXTURE_PX // 4))


def _stripes(rng: np.random.Generator) -> NDArray[np.float32]:
    stripes = rng.normal(size=TEXTURE_PX // CELL_PX).astype(np.float32).repeat(CELL_PX)
    return _normalised(stripes[None, :] + 0.2 * _noise(rng, TEXTURE_PX // 4, TEXTURE_PX // 4))


_PAINTERS = {"boards": _boards, "stone": _stone, "cloth": _cloth, "stripes": _stripes}


def _normalised(relief: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.asarray((relief - relief.mean()) / relief.std(), dtype=np.float32)
