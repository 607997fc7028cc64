"""What surfaces look like: small painted tiles, packed into one texture per object.

Everything is painted with integers or with whole random draws, never with filters, so that a tile has the same bytes
on every machine.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

TEXTURE_PX = 128

Pixels = NDArray[np.uint8]
Rgb = tuple[int, int, int]

WHITE: Rgb = (238, 236, 230)
BLACK: Rgb = (28, 28, 32)
STEEL: Rgb = (168, 172, 178)
RED: Rgb = (200, 40, 36)
YELLOW: Rgb = (240, 196, 40)
GREEN: Rgb = (52, 140, 70)
BLUE: Rgb = (40, 84, 170)
ORANGE: Rgb = (236, 120, 32)
PINK: Rgb = (230, 130, 150)
CREAM: Rgb = (236, 220, 180)
WOOD: Rgb = (190, 138, 84)


@dataclass(frozen=True, slots=True, eq=False)
class Finish:
    """A painted tile and how it lies on a solid."""

    pixels: Pixels
    """Top row first. Shape (h, w, 3)."""
    each_face: bool = False
    """Whether every face of a side shows the whole tile, as on a carton, or the tile runs once around."""
    span: tuple[float, float] = (0.0, 1.0)
    """The share of the tile's width that is used."""

    def part(self, number: int, parts: int) -> Finish:
        """The finish of piece ``number`` of a side that was cut into ``parts``."""
        return replace(self, span=(number / parts, (number + 1) / parts))


def plain(colour: Rgb) -> Finish:
    """One colour."""
    return Finish(np.full((4, 4, 3), colour, np.uint8))


def speckled(colour: Rgb, rng: np.random.Generator, spread: int = 14) -> Finish:
    """A colour with fine grain: ceramic, foam, brushed metal, skin of a fruit."""
    grain = rng.integers(-spread, spread + 1, size=(24, 24, 1))
    return Finish(_clip(np.array(colour) + grain))


def wooden(rng: np.random.Generator, colour: Rgb = WOOD) -> Finish:
    """Grain along the solid's axis."""
    columns = rng.integers(-26, 14, size=(1, 20, 1))
    return Finish(_clip(np.array(colour) + columns + rng.integers(-5, 6, size=(40, 20, 1))))


def bristled(colour: Rgb, rng: np.random.Generator) -> Finish:
    """Dark gaps between tufts."""
    tufts = np.where(np.arange(32)[None, :, None] % 4 == 0, -60, 0)
    return Finish(_clip(np.array(colour) + tufts + rng.integers(-18, 19, size=(16, 32, 1))))


def banded(colours: Sequence[Rgb], heights: Sequence[int]) -> Finish:
    """Bands around the solid, from its top down; ``heights`` in pixels."""
    rows = [np.full((height, 4, 3), colour) for colour, height in zip(colours, heights, strict=True)]
    return Finish(np.concatenate(rows).astype(np.uint8))


def striped(colours: Sequence[Rgb], repeats: int) -> Finish:
    """Stripes along the solid's axis."""
    stripes = np.array(list(colours) * repeats, np.uint8)[None].repeat(4, axis=1)
    return Finish(np.tile(stripes, (4, 1, 1)))


def labelled(
    background: Rgb,
    panel: Rgb,
    text: str,
    ink: Rgb = WHITE,
    *,
    size: tuple[int, int] = (64, 48),
    faces: int = 1,
    lengthwise: bool = False,
) -> Finish:
    """A printed panel with a word on it: on every face of a carton, or ``faces`` times around a can.

    ``size`` is the width and height of one print in pixels; with ``lengthwise`` the word runs along the solid's axis.
    """
    width, height = size
    tile = np.full((height, width, 3), background, np.uint8)
    cv2.rectangle(tile, (0, height // 4), (width - 1, height - height // 4), panel, cv2.FILLED)
    cv2.rectangle(tile, (0, height // 8), (width - 1, height // 8 + 1), panel, cv2.FILLED)
    _write(tile, text, ink, margin=4 if faces == 1 or lengthwise else width // 3)
    if lengthwise:
        tile = np.rot90(tile)
    return Finish(np.tile(tile, (1, faces, 1)), each_face=faces == 1)


def wrapped(pixels: Pixels) -> Finish:
    """A picture that runs once around the side."""
    return Finish(pixels)


def keyed(case: Rgb, keys: Sequence[Rgb], rows: int, columns: int) -> Finish:
    """Rows of keys, as on a remote control."""
    tile = np.full((8 * rows + 4, 8 * columns + 4, 3), case, np.uint8)
    for row in range(rows):
        for column in range(columns):
            corner = (8 * column + 4, 8 * row + 4)
            colour = keys[(row * columns + column) % len(keys)]
            cv2.rectangle(tile, corner, (corner[0] + 4, corner[1] + 4), colour, cv2.FILLED)
    return Finish(tile)


def spotted(ground: Rgb, spot: Rgb, radius_px: int = 5, size_px: int = 24) -> Finish:
    """One disc in the middle of the tile: an eye, a wheel's hub, the dot on a lid."""
    tile = np.full((size_px, size_px, 3), ground, np.uint8)
    cv2.circle(tile, (size_px // 2, size_px // 2), radius_px, spot, cv2.FILLED)
    return Finish(tile, each_face=True)


def _write(tile: Pixels, text: str, ink: Rgb, *, margin: int) -> None:
    """Centre a word, as large as the tile's width less ``margin`` allows."""
    font = cv2.FONT_HERSHEY_SIMPLEX
    scale = max(s for s in (0.2, 0.3, 0.4, 0.5, 0.6) if s == 0.2 or _width(text, s) <= tile.shape[1] - margin)
    (width, height), _ = cv2.getTextSize(text, font, scale, 1)
    corner = ((tile.shape[1] - width) // 2, (tile.shape[0] + height) // 2)
    cv2.putText(tile, text, corner, font, scale, ink, 1, cv2.LINE_8)


def _width(text: str, scale: float) -> int:
    (width, _), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, scale, 1)
    return int(width)


def _clip(values: NDArray[np.int64]) -> Pixels:
    return np.clip(values, 0, 255).astype(np.uint8)


@dataclass(frozen=True, slots=True, eq=False)
class Atlas:
    """The tiles of one object in one square texture."""

    pixels: Pixels
    """Shape (TEXTURE_PX, TEXTURE_PX, 3)."""
    corners: dict[int, tuple[int, int]]
    """Column and row of each tile's top left corner, by the identity of its pixels."""

    def uv(self, finish: Finish, u: float, v: float) -> tuple[float, float]:
        """Texture coordinates of the point (u, v) of a tile, both in [0, 1], v upwards.

        Points stay half a pixel inside the tile, so that neighbours do not bleed into it.
        """
        column, row = self.corners[id(finish.pixels)]
        height, width = finish.pixels.shape[:2]
        left, right = finish.span
        across = left + u * (right - left)
        return (
            (column + 0.5 + across * (width - 1)) / TEXTURE_PX,
            1 - (row + 0.5 + (1 - v) * (height - 1)) / TEXTURE_PX,
        )


def pack(finishes: Sequence[Finish]) -> Atlas:
    """Put tiles on shelves, tallest first, each tile once."""
    tiles = {id(finish.pixels): finish.pixels for finish in finishes}
    pixels = np.zeros((TEXTURE_PX, TEXTURE_PX, 3), np.uint8)
    corners: dict[int, tuple[int, int]] = {}
    column, row, shelf = 0, 0, 0
    for key, tile in sorted(tiles.items(), key=lambda item: -item[1].shape[0]):
        height, width = tile.shape[:2]
        if column + width > TEXTURE_PX:
            column, row, shelf = 0, row + shelf, 0
        if row + height > TEXTURE_PX or width > TEXTURE_PX:
            raise ValueError(f"the tiles of an object do not fit into a texture of {TEXTURE_PX} pixels")
        pixels[row : row + height, column : column + width] = tile
        corners[key] = (column, row)
        column, shelf = column + width, max(shelf, height)
    return Atlas(pixels, corners)
