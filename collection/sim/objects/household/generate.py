"""Writes the household objects into the cache, once per machine."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np

from handsight.collection.sim.objects.cache import cache_root, publish
from handsight.collection.sim.objects.household.build import rigid_object
from handsight.collection.sim.objects.household.table import (
    GENERATOR_SEED,
    GENERATOR_VERSION,
    TEST,
    TRAIN,
    HouseholdObject,
)
from handsight.collection.sim.objects.manifest import Manifest, ObjectEntry, folder_digest
from handsight.collection.sim.objects.urdf import write_object

SET_NAME = "household"
LICENCE = "MIT"


def household_folder() -> Path:
    """The folder of the household objects, made if this machine has none yet.

    Raises:
        ObjectSetError: the cache cannot be written.
    """
    folder = cache_root() / f"{SET_NAME}-{_digest()[:16]}"
    if not folder.is_dir():
        publish(folder, write_household)
    return folder


def write_household(folder: Path) -> None:
    """Write all objects and their manifest into an empty folder; the bytes are the same on every machine."""
    entries = [_write(item, folder, split) for items, split in ((TRAIN, "train"), (TEST, "test")) for item in items]
    settings = {"seed": GENERATOR_SEED, "version": GENERATOR_VERSION}
    Manifest(name=SET_NAME, settings=settings, objects=tuple(entries)).write(folder)


def _write(item: HouseholdObject, folder: Path, split: str) -> ObjectEntry:
    model = rigid_object(item)
    place = folder / item.name
    place.mkdir()
    write_object(model, place)
    extent_m = np.ptp(np.concatenate([part.vertices_m for part in model.parts]), axis=0).round(4).tolist()
    return ObjectEntry(
        name=item.name,
        source=item.source,
        scale=1.0,
        licence=LICENCE,
        sha256=folder_digest(place),
        split=split,
        mass_kg=item.mass_kg,
        size_m=(extent_m[0], extent_m[1], extent_m[2]),
    )


def _digest() -> str:
    """Of everything that decides what the objects are: seed, version, table, and the code of the generators.

    With the code in it, a changed shape never meets an old cache, even where somebody forgot to raise the version.
    """
    rows = [(item.name, item.mass_kg, item.friction, item.source) for item in (*TRAIN, *TEST)]
    digest = hashlib.sha256(repr((GENERATOR_SEED, GENERATOR_VERSION, rows)).encode())
    here = Path(__file__).parent
    for path in sorted([*here.glob("*.py"), here.parent / "urdf.py", here.parent / "wavefront.py"]):
        digest.update(path.read_bytes())
    return digest.hexdigest()
