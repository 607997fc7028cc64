"""A picture of a whole object set, for documents and for looking at what an import made."""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from handsight.collection.sim.bullet import BulletClient, connect, pybullet
from handsight.collection.sim.objects.model import ObjectModel

TILE_PX = 168
_OVERSAMPLING = 2
_FOV_DEG = 28.0
_YAW_DEG, _PITCH_DEG = 22.0, -36.0
_LIGHT = (0.3, -0.6, 1.0)
_INK = (70, 70, 70)
_MARGIN_PX = 10
"""Room around an object, for its name below it."""


def contact_sheet(models: Sequence[ObjectModel], *, columns: int = 10) -> NDArray[np.uint8]:
    """Every object in the pose in which it is usually kept, filling its tile, with its name. RGB, shape (H, W, 3)."""
    bullet = connect()
    try:
        tiles = [_named(_portrait(bullet, model), model.object_id.split("/")[-1]) for model in models]
    finally:
        bullet.disconnect()
    blank = np.full((TILE_PX, TILE_PX, 3), 255, np.uint8)
    tiles += [blank] * (-len(tiles) % columns)
    rows = [np.hstack(tiles[first : first + columns]) for first in range(0, len(tiles), columns)]
    return np.vstack(rows)


def _portrait(bullet: BulletClient, model: ObjectModel) -> NDArray[np.uint8]:
    """One object on white. Shape (TILE_PX, TILE_PX, 3)."""
    bullet.resetSimulation()
    body = bullet.loadURDF(str(model.urdf), globalScaling=model.scale)
    low, high = np.array(bullet.getAABB(body))
    distance_m = 0.5 * float(np.linalg.norm(high - low)) / math.sin(math.radians(0.5 * _FOV_DEG))
    target = (0.5 * (low + high)).tolist()
    view = bullet.computeViewMatrixFromYawPitchRoll(target, distance_m, _YAW_DEG, _PITCH_DEG, 0, 2)
    lens = bullet.computeProjectionMatrixFOV(_FOV_DEG, 1.0, 0.01, 2 * distance_m)
    size = (TILE_PX - 2 * _MARGIN_PX) * _OVERSAMPLING
    picture = bullet.getCameraImage(
        size, size, view, lens, shadow=0, lightDirection=_LIGHT, renderer=pybullet.ER_TINY_RENDERER
    )
    rgb = np.reshape(picture[2], (size, size, 4))[:, :, :3].astype(np.uint8)
    small = cv2.resize(rgb, None, fx=1 / _OVERSAMPLING, fy=1 / _OVERSAMPLING, interpolation=cv2.INTER_AREA)
    tile = np.full((TILE_PX, TILE_PX, 3), 255, np.uint8)
    tile[: len(small), _MARGIN_PX : TILE_PX - _MARGIN_PX] = small
    return tile


def _named(tile: NDArray[np.uint8], name: str) -> NDArray[np.uint8]:
    font, scale = cv2.FONT_HERSHEY_SIMPLEX, 0.4
    (width, _), _ = cv2.getTextSize(name, font, scale, 1)
    corner = (max(2, (TILE_PX - width) // 2), TILE_PX - 6)
    cv2.putText(tile, name, corner, font, scale, _INK, 1, cv2.LINE_AA)
    return tile
