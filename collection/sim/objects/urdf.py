"""Writes one object into a folder: convex parts, skin, texture, and the URDF that names them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from handsight.collection.sim.objects.wavefront import ConvexPart, Skin, collision_text, material_text, skin_text

URDF_FILE = "object.urdf"
_COLLISION_FILE = "collision.obj"
_SKIN_FILE = "skin.obj"
_MATERIAL_FILE = "skin.mtl"
_TEXTURE_FILE = "texture.png"

_URDF = """<?xml version="1.0" encoding="utf-8"?>
<robot name="{name}">
  <link name="object">
    <contact>
      <lateral_friction value="{friction:.2f}"/>
    </contact>
    <inertial>
      <mass value="{mass:.4f}"/>
      <inertia ixx="{ixx:.9f}" ixy="{ixy:.9f}" ixz="{ixz:.9f}" iyy="{iyy:.9f}" iyz="{iyz:.9f}" izz="{izz:.9f}"/>
    </inertial>
    <visual>
      <geometry><mesh filename="{skin}"/></geometry>
      <material name="skin"><color rgba="{red:.3f} {green:.3f} {blue:.3f} 1"/></material>
    </visual>
    <collision>
      <geometry><mesh filename="{collision}"/></geometry>
    </collision>
  </link>
</robot>
"""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RigidObject:
    """Everything that is written about one object."""

    name: str
    parts: Sequence[ConvexPart]
    skin: Skin
    texture: NDArray[np.uint8] | None
    """RGB, top row first. Shape (h, w, 3)."""
    colour: tuple[float, float, float]
    """Multiplies the texture; in [0, 1]."""
    mass_kg: float
    friction: float
    """Lateral, as PyBullet multiplies it with that of the other body."""


@dataclass(frozen=True, slots=True, eq=False)
class MassProperties:
    """Where the mass of an object sits."""

    centre_m: NDArray[np.float64]
    """Shape (3,)."""
    inertia_kg_m2: NDArray[np.float64]
    """About the centre of mass, along the object's axes. Shape (3, 3)."""


def mass_properties(parts: Sequence[ConvexPart], mass_kg: float) -> MassProperties:
    """Centre of mass and inertia of solid parts that weigh ``mass_kg`` together; overlaps count twice."""
    pieces = [_moments(part) for part in parts]
    total = sum(mass for mass, _, _ in pieces)
    scale = mass_kg / total
    centre = sum((first for _, first, _ in pieces), start=np.zeros(3)) / total
    second = sum((moment for _, _, moment in pieces), start=np.zeros((3, 3))) * scale
    # Steiner: second moments about the centre of mass; the inertia tensor is their trace minus themselves.
    central = second - mass_kg * np.outer(centre, centre)
    # Rounded as the files are, and free of negative zeros, so that every machine writes the same bytes.
    return MassProperties(np.round(centre, 6) + 0.0, np.round(np.trace(central) * np.eye(3) - central, 9) + 0.0)


def _moments(part: ConvexPart) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
    """Mass, first and second moments of one part, as the sum over the tetrahedra between its faces and the origin."""
    corners = part.vertices_m[part.triangles]  # (T, 3, 3)
    volumes = np.linalg.det(corners) / 6 * part.density  # (T,)
    sums = corners.sum(axis=1)  # (T, 3)
    first = (volumes[:, None] * sums / 4).sum(axis=0)
    products = np.einsum("tki,tkj->tij", corners, corners) + np.einsum("ti,tj->tij", sums, sums)
    second = (volumes[:, None, None] * products / 20).sum(axis=0)
    return float(volumes.sum()), first, second


def write_object(item: RigidObject, folder: Path) -> None:
    """Write the files of one object into ``folder``, which must exist. The origin is the centre of mass."""
    mass = mass_properties(item.parts, item.mass_kg)
    texture_file = None
    if item.texture is not None:
        texture_file = _TEXTURE_FILE
        # Stored without compression, whose output would depend on the version of the library.
        _, png = cv2.imencode(".png", item.texture[:, :, ::-1], [cv2.IMWRITE_PNG_COMPRESSION, 0])
        (folder / texture_file).write_bytes(png.tobytes())
    _write(folder / _COLLISION_FILE, collision_text(item.parts, mass.centre_m))
    _write(folder / _SKIN_FILE, skin_text(item.skin, mass.centre_m, _MATERIAL_FILE))
    _write(folder / _MATERIAL_FILE, material_text(texture_file))
    inertia = mass.inertia_kg_m2
    red, green, blue = item.colour
    text = _URDF.format(
        name=item.name,
        friction=item.friction,
        mass=item.mass_kg,
        ixx=inertia[0, 0],
        ixy=inertia[0, 1],
        ixz=inertia[0, 2],
        iyy=inertia[1, 1],
        iyz=inertia[1, 2],
        izz=inertia[2, 2],
        skin=_SKIN_FILE,
        collision=_COLLISION_FILE,
        red=red,
        green=green,
        blue=blue,
    )
    _write(folder / URDF_FILE, text)


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8", newline="\n")
