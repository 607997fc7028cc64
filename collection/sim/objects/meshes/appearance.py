"""How an imported mesh looks: its own texture or colour where it has one, else a colour drawn from its name."""

from __future__ import annotations

import colorsys
import hashlib
from typing import Any

import cv2
import numpy as np
import trimesh
from numpy.typing import NDArray

from handsight.collection.sim.objects.wavefront import Skin

MAX_TEXTURE_PX = 256
Colour = tuple[float, float, float]
WHITE: Colour = (1.0, 1.0, 1.0)


def appearance(mesh: trimesh.Trimesh, name: str) -> tuple[Skin, NDArray[np.uint8] | None, Colour]:
    """The visible surface, its texture if there is one, and the colour that multiplies it."""
    uv, image = _texture(mesh.visual)
    corners = mesh.faces
    skin = Skin(
        vertices_m=np.asarray(mesh.vertices)[corners],
        normals=np.asarray(mesh.vertex_normals)[corners],
        uv=None if uv is None else uv[corners],
    )
    if image is not None:
        return skin, image, WHITE
    return skin, None, _colour(mesh.visual) or _named_colour(name)


def _texture(visual: Any) -> tuple[NDArray[np.float64] | None, NDArray[np.uint8] | None]:
    """Texture coordinates per vertex and the picture they refer to; both or neither."""
    picture = _picture(visual)
    if picture is None:
        return None, None
    image = np.asarray(picture.convert("RGB"), dtype=np.uint8)
    shrink = min(1.0, MAX_TEXTURE_PX / max(image.shape[:2]))
    if shrink < 1.0:
        height, width = (max(1, round(side * shrink)) for side in image.shape[:2])
        image = np.asarray(cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA), np.uint8)
    return np.asarray(visual.uv, np.float64), image


def has_texture(mesh: trimesh.Trimesh) -> bool:
    """Whether a picture covers the surface."""
    return _picture(mesh.visual) is not None


def lacks_coordinates(mesh: trimesh.Trimesh) -> bool:
    """Whether there is a picture for the surface, and no telling what of it goes where."""
    return _material_picture(mesh.visual) is not None and not has_texture(mesh)


def _picture(visual: Any) -> Any:
    """The Pillow image that texture coordinates refer to; None where there is no image or there are no coordinates."""
    return None if getattr(visual, "uv", None) is None else _material_picture(visual)


def _material_picture(visual: Any) -> Any:
    material = getattr(visual, "material", None)
    return getattr(material, "image", None) or getattr(material, "baseColorTexture", None)


def _colour(visual: Any) -> Colour | None:
    """The mean of vertex or face colours, or the material's colour; None where the file says nothing."""
    if getattr(visual, "kind", None) in ("vertex", "face"):
        values = visual.vertex_colors if visual.kind == "vertex" else visual.face_colors
        red, green, blue = (np.asarray(values)[:, :3].mean(axis=0) / 255).tolist()
        return red, green, blue
    main = getattr(getattr(visual, "material", None), "main_color", None)
    if main is None:
        return None
    red, green, blue = (np.asarray(main)[:3] / 255).tolist()
    return red, green, blue


def _named_colour(name: str) -> Colour:
    """A saturated colour that depends on nothing but the name."""
    hue = hashlib.sha256(name.encode()).digest()[0] / 256
    return colorsys.hsv_to_rgb(hue, 0.6, 0.8)
