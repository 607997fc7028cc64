"""Every parser of input from elsewhere: good input for it, how it is spoilt, and the public way in."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import tests.support.fuzz_sources as sources
import tests.support.fuzz_spoilers as spoilers
import tests.support.fuzz_words as words
from tests.support.foreign_sets import HDF5_MAP, LEROBOT_MAP
from tests.support.fuzz_mutations import mutate_file, mutate_folder
from tests.support.fuzz_sources import command

from handsight.collection.sim.objects.catalogue import load_object_set
from handsight.collection.sim.objects.meshes.plan import plan_import
from handsight.collection.ur10.rig_file import load_rig
from handsight.collection.ur10.station_factory import Ur10StationFactory
from handsight.datasets import GraspDataset
from handsight.datasets.inputs.materialize import materialize
from handsight.training.run import load_run


@dataclass(frozen=True, slots=True, kw_only=True)
class Parser:
    """Something that reads what it did not write."""

    make: Callable[[Path], None]
    """Fill an empty folder with good input."""
    spoil: Callable[[Path, np.random.Generator], Any]
    """Change it, or say what to ask of it."""
    parse: Callable[[Path, Any], int]
    """Read it: exit status. Typed errors are raised."""
    quick: bool = False
    """Whether an input takes milliseconds: of the others a sixteenth is tried in a run over all parsers."""

    def share_of(self, inputs: int) -> int:
        """How many of so many inputs are tried in a run over all parsers."""
        return inputs if self.quick else max(1, inputs // 16)


def import_of(name: str, folder: Path, _: Any) -> int:
    """A whole import, by the map where there is one; the dataset it would make is taken away again."""
    mapped = ["--map", str(folder / "map.toml")] if os.path.lexists(folder / "map.toml") else []
    try:
        return command("dataset", "import", str(folder / name), str(folder / "new"), *mapped)
    finally:
        shutil.rmtree(folder / "new", ignore_errors=True)


def parse_meshes(folder: Path, _: Any) -> int:
    """What an import reads, without cutting anything."""
    plan_import(folder / "meshes", "mine")
    return 0


def parse_object_set(folder: Path, _: Any) -> int:
    """A set by its folder."""
    load_object_set(str(folder / "set"))
    return 0


def parse_run(folder: Path, _: Any) -> int:
    """A run by its folder."""
    load_run(folder / "run")
    return 0


def parse_rig(folder: Path, _: Any) -> int:
    """A rig by its file, with the calibration beside it, as far as nothing is connected."""
    Ur10StationFactory.of(load_rig(folder / "rig.toml")).settings()
    return 0


def parse_cache(folder: Path, _: Any) -> int:
    """Inputs by way of their cache, which are right whatever became of it."""
    inputs = materialize(GraspDataset.open(str(folder / "grasps")), grid=sources.CACHED_GRID).inputs
    np.testing.assert_array_equal(inputs, np.load(folder / "expected.npy"))
    return 0


def parse_dataset(folder: Path, given: list[list[str]] | None) -> int:
    """Commands that read what is stored: of several the worst status."""
    dataset = str(folder / "grasps")
    # The doctor has something to say of made-up attempts, sound as they are.
    asked = [words for words in spoilers.READING if words[0] != "doctor"] if given is None else given
    return max(command("dataset", verb, dataset, *rest) for verb, *rest in asked)


PARSERS: dict[str, Parser] = {
    "options": Parser(make=sources.make_curated, spoil=words.option_words, parse=words.parse_words),
    "where": Parser(make=sources.make_dataset, spoil=words.where_words, parse=words.parse_words),
    "refs": Parser(make=sources.make_curated, spoil=words.ref_words, parse=words.parse_words),
    "environment": Parser(make=sources.make_dataset, spoil=words.environment_words, parse=words.parse_in_environment),
    "stored": Parser(make=sources.make_curated, spoil=spoilers.spoil_metadata, parse=parse_dataset),
    "columns": Parser(make=sources.make_curated, spoil=spoilers.spoil_columns, parse=parse_dataset),
    "attributes": Parser(make=sources.make_curated, spoil=spoilers.spoil_attributes, parse=parse_dataset),
    **{
        name: Parser(
            make=sources.make_images, spoil=partial(spoilers.spoil_images, file), parse=partial(import_of, "set")
        )
        for name, file in (("station", "station.json"), ("csv", "attempts.csv"), ("pictures", "*.png"))
    },
    "hdf5": Parser(
        make=partial(sources.make_export, "hdf5", "grasps.hdf5"),
        spoil=spoilers.spoil_hdf5_file,
        parse=partial(import_of, "grasps.hdf5"),
    ),
    "zarr": Parser(
        make=partial(sources.make_export, "zarr", "set.zarr"),
        spoil=spoilers.spoil_zarr_folder,
        parse=partial(import_of, "set.zarr"),
    ),
    "lerobot": Parser(
        make=partial(sources.make_export, "lerobot", "set"),
        spoil=spoilers.spoil_lerobot,
        parse=partial(import_of, "set"),
    ),
    "map": Parser(
        make=sources.make_foreign_hdf5,
        spoil=partial(spoilers.spoil_map, HDF5_MAP),
        parse=partial(import_of, "demos.hdf5"),
    ),
    "map-lerobot": Parser(
        make=sources.make_foreign_lerobot,
        spoil=partial(spoilers.spoil_map, LEROBOT_MAP),
        parse=partial(import_of, "set"),
    ),
    "hdf5-set": Parser(
        make=sources.make_foreign_hdf5,
        spoil=spoilers.spoil_hdf5_file,
        parse=partial(import_of, "demos.hdf5"),
    ),
    "lerobot-set": Parser(
        make=sources.make_foreign_lerobot,
        spoil=spoilers.spoil_lerobot,
        parse=partial(import_of, "set"),
    ),
    "run": Parser(make=sources.make_run, spoil=spoilers.spoil_run, parse=parse_run, quick=True),
    "rig": Parser(
        make=sources.make_rig, spoil=lambda f, rng: mutate_file(f / "rig.toml", rng), parse=parse_rig, quick=True
    ),
    "calibration": Parser(
        make=sources.make_rig,
        spoil=lambda f, rng: mutate_file(f / "calibration.json", rng),
        parse=parse_rig,
        quick=True,
    ),
    "cache": Parser(make=sources.make_cache, spoil=spoilers.spoil_cache, parse=parse_cache),
    "object-set": Parser(
        make=sources.make_object_set,
        spoil=lambda f, rng: mutate_folder(f / "set", rng),
        parse=parse_object_set,
        quick=True,
    ),
    **{
        suffix: Parser(
            make=partial(sources.make_mesh, suffix),
            spoil=partial(spoilers.spoil_mesh, suffix),
            parse=parse_meshes,
            quick=True,
        )
        for suffix in ("obj", "mtl", "stl", "ply", "glb")
    },
}
