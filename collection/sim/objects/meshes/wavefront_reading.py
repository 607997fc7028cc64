"""A Wavefront file with its materials and pictures, as trimesh reads it without surprises."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import trimesh

from handsight.collection.sim.objects.meshes.companions import Companions
from handsight.collection.sim.objects.meshes.declared import check_text_size
from handsight.collection.sim.objects.meshes.fault import MeshFault, shown
from handsight.collection.sim.objects.meshes.mtl import Material, read_mtl
from handsight.collection.sim.objects.meshes.obj import LIBRARY, material_name, read_obj


def wavefront_for_reader(content: bytes, companions: Companions, *, plain: bool) -> tuple[bytes, dict[str, Material]]:
    """The file written anew, and its materials by the names that they have there.

    ``companions`` then hands out one library, and the pictures that it names.

    Raises:
        MeshFault: The file, or a library of it, makes no sense; names the line.
    """
    check_text_size(content)
    wavefront = read_obj(content, plain=plain)
    library = _library(wavefront.libraries, companions)
    materials = {
        material_name(number): library[name] for number, name in enumerate(wavefront.materials) if name in library
    }
    companions.stand_ins[LIBRARY] = "\n".join(_statements(materials, companions)).encode()
    return wavefront.text.encode(), materials


def _library(names: Sequence[str], companions: Companions) -> dict[str, Material]:
    """The materials of all libraries; where two have a name in common, the first one counts."""
    materials: dict[str, Material] = {}
    for name in names:
        # One line may name several libraries, and a library may have spaces in its name.
        for one in [name] if companions.has(name) or " " not in name else name.split():
            try:
                materials = {**read_mtl(companions.get(one)), **materials}
            except FileNotFoundError:
                # It is among the faults of the companions, and all of them are reported at once.
                continue
            except MeshFault as fault:
                companions.faults.append(f"names {shown(one)!r}, which is wrong in {fault}")
    return materials


def _statements(materials: Mapping[str, Material], companions: Companions) -> list[str]:
    lines = []
    for name, material in materials.items():
        lines.append(f"newmtl {name}")
        if material.colour is not None:
            lines.append("Kd " + " ".join(map(str, material.colour)))
        if material.picture:
            try:
                companions.stand_ins[f"{name}.picture"] = companions.get(material.picture)
            except FileNotFoundError:
                continue
            lines.append(f"map_Kd {name}.picture")
    return lines


def place_pictures(scene: trimesh.Scene, materials: Mapping[str, Material]) -> None:
    """Lay pictures on the surfaces as the options of their libraries say."""
    for mesh in scene.geometry.values():
        # trimesh's classes of looks carry no annotations.
        visual: Any = getattr(mesh, "visual", None)
        material = materials.get(getattr(getattr(visual, "material", None), "name", None) or "")
        if material is None or getattr(visual, "uv", None) is None:
            continue
        visual.uv = np.asarray(visual.uv) * material.repeat + material.offset
