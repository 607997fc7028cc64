"""The object sets by name: those that ship, those that were imported, and any folder that holds a manifest."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from handsight.collection.errors import ObjectSetError
from handsight.collection.sim.objects.blocks import blocks
from handsight.collection.sim.objects.cache import cache_root
from handsight.collection.sim.objects.household.generate import household_folder
from handsight.collection.sim.objects.manifest import MANIFEST_FILE, load_models, read_manifest
from handsight.collection.sim.objects.model import ObjectModel
from handsight.datasets.writable import link_fault

IMPORTED_FOLDER = "imported"
OBJECTS_PER_SCENE = 5
"""As in the paper, section V-B."""
CLUTTER_PER_SCENE = 10


@dataclass(frozen=True, slots=True, kw_only=True)
class BuiltInSet:
    """A set that comes with handsight."""

    description: str
    licence: str
    load: Callable[[], tuple[ObjectModel, ...]]
    per_scene: int = OBJECTS_PER_SCENE
    """Objects in a scene unless the caller says otherwise."""


OBJECT_SETS: dict[str, BuiltInSet] = {
    "blocks-train": BuiltInSet(
        description="procedural shapes of PyBullet, numbers not ending in 0",
        licence="zlib",
        load=lambda: blocks(held_out=False),
    ),
    "blocks-test": BuiltInSet(
        description="procedural shapes of PyBullet, numbers ending in 0",
        licence="zlib",
        load=lambda: blocks(held_out=True),
    ),
    "household-train": BuiltInSet(
        description="household objects built from convex parts, textured",
        licence="MIT",
        load=lambda: load_models(household_folder(), splits=("train",)),
    ),
    "household-test": BuiltInSet(
        description="novel household objects of other shapes",
        licence="MIT",
        load=lambda: load_models(household_folder(), splits=("test",)),
    ),
    "clutter-train": BuiltInSet(
        description="household-train, ten in a scene: heaps and touching objects",
        licence="MIT",
        load=lambda: load_models(household_folder(), splits=("train",)),
        per_scene=CLUTTER_PER_SCENE,
    ),
    "clutter-test": BuiltInSet(
        description="household-test, ten in a scene",
        licence="MIT",
        load=lambda: load_models(household_folder(), splits=("test",)),
        per_scene=CLUTTER_PER_SCENE,
    ),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class ObjectSetInfo:
    """What a list of object sets shows of one."""

    name: str
    objects: int
    licence: str
    description: str
    folder: Path | None
    """Where an imported set lies; None for sets that come with handsight."""


def objects_per_scene(name: str) -> int:
    """How many objects of a set make a scene unless the caller says otherwise."""
    return OBJECT_SETS[name].per_scene if name in OBJECT_SETS else OBJECTS_PER_SCENE


def imported_folder(name: str) -> Path:
    """Where the imported set of that name lies, or would lie."""
    return cache_root() / IMPORTED_FOLDER / name


def load_object_set(name: str) -> tuple[ObjectModel, ...]:
    """The models of a set, in a fixed order.

    ``name`` is a set that comes with handsight, one that was imported, or the path of a folder that holds a manifest.

    Raises:
        ObjectSetError: No such set, or one that is damaged.
    """
    if name in OBJECT_SETS:
        return _built_in(name, cache_root())
    folder = _folder_of(name)
    if folder is None:
        _refuse_links(name)
        known = ", ".join(info.name for info in list_object_sets())
        raise ObjectSetError(
            f"unknown object set {name!r}, expected one of: {known}; or the folder of a set; to make one, "
            "see 'handsight objects import --help'"
        )
    return load_models(folder)


@cache
def _built_in(name: str, root: Path) -> tuple[ObjectModel, ...]:
    """Kept per cache root, so that a process hashes the files of a set once."""
    del root
    return OBJECT_SETS[name].load()


def _folder_of(name: str) -> Path | None:
    """The folder of an imported set, or the folder that ``name`` itself is."""
    if name and Path(name).name == name and (imported_folder(name) / MANIFEST_FILE).is_file():
        return imported_folder(name)
    # "." and the like name folders; the empty string, which Path takes for ".", does not.
    return Path(name) if name and Path(name).is_dir() else None


def _refuse_links(name: str) -> None:
    """Name the link to a set that is not there, as on a disk that is not mounted.

    Raises:
        ObjectSetError: A link of that name leads nowhere.
    """
    for place in (Path(name), imported_folder(Path(name).name)):
        if name and (fault := link_fault(place)) is not None:
            raise ObjectSetError(f"{fault}: mend the link, or name another object set")


def list_object_sets() -> list[ObjectSetInfo]:
    """The sets that can be named on this machine: first those that come with handsight, then imported ones."""
    return [*(_built_in_info(name) for name in OBJECT_SETS), *_imported_infos()]


def _built_in_info(name: str) -> ObjectSetInfo:
    built_in = OBJECT_SETS[name]
    return ObjectSetInfo(
        name=name,
        objects=len(load_object_set(name)),
        licence=built_in.licence,
        description=built_in.description,
        folder=None,
    )


def _imported_infos() -> list[ObjectSetInfo]:
    # A half-written set has a name that starts with a dot.
    return [_imported_info(path.parent) for path in sorted(imported_folder("").glob(f"[!.]*/{MANIFEST_FILE}"))]


def _imported_info(folder: Path) -> ObjectSetInfo:
    try:
        manifest = read_manifest(folder)
    except ObjectSetError as error:
        # A set that cannot be used is listed with the reason, and does not hide the others.
        return ObjectSetInfo(name=folder.name, objects=0, licence="", description=str(error), folder=folder)
    return ObjectSetInfo(
        name=folder.name,
        objects=len(manifest.objects),
        licence=", ".join(sorted({entry.licence for entry in manifest.objects})),
        description=f"imported from {manifest.settings.get('folder', 'meshes')}",
        folder=folder,
    )
