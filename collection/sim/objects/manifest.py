"""The manifest of an object set on disk: what each object is, where it comes from, and the hash that pins it.

A set is a folder with ``manifest.json`` and one folder per object. A set is refused when a file is missing or differs
from its hash: an attempt recorded with a damaged object could not be simulated again.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from handsight.collection.errors import ObjectSetError
from handsight.collection.sim.objects.model import ObjectModel
from handsight.collection.sim.objects.urdf import URDF_FILE
from handsight.datasets.errors import HeaderError
from handsight.datasets.format.typed import listed, shown, typed

MANIFEST_FILE = "manifest.json"
MANIFEST_FORMAT = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class ObjectEntry:
    """One object of a set."""

    name: str
    """Also the name of its folder."""
    source: str
    """The mesh it was made from, or where its size and mass come from."""
    scale: float
    """Metres per unit of the source."""
    licence: str
    sha256: str
    """Of the files in the object's folder, see :func:`folder_digest`."""
    split: str
    """``train``, ``test``, or ``all`` for objects that a user brought."""
    mass_kg: float
    size_m: tuple[float, float, float]
    """Extent along x, y and z of the object's frame [m]."""
    source_sha256: str = ""
    """Of the mesh file it was made from; empty for generated objects."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Manifest:
    """A set of objects."""

    name: str
    settings: dict[str, Any]
    """How the set was made, as JSON values."""
    objects: tuple[ObjectEntry, ...]

    def write(self, folder: Path) -> None:
        """Write the manifest into the set's folder."""
        content = {"format": MANIFEST_FORMAT, **asdict(self)}
        text = json.dumps(content, indent=1, sort_keys=True, ensure_ascii=False) + "\n"
        (folder / MANIFEST_FILE).write_text(text, encoding="utf-8", newline="\n")


def folder_digest(folder: Path) -> str:
    """SHA-256 over the names and contents of the files in a folder, in the order of their names."""
    digest = hashlib.sha256()
    for path in sorted(folder.iterdir()):
        content = path.read_bytes()
        digest.update(f"{path.name}\0{len(content)}\0".encode())
        digest.update(content)
    return digest.hexdigest()


def read_manifest(folder: Path) -> Manifest:
    """Read and check the manifest of a set.

    Raises:
        ObjectSetError: There is none, or it does not describe a set.
    """
    path = folder / MANIFEST_FILE
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise ObjectSetError(
            f"{folder} holds no {MANIFEST_FILE}, expected the folder of an object set; "
            "to make one of a folder of meshes, see 'handsight objects import --help'"
        ) from error
    except (OSError, ValueError, RecursionError) as error:
        raise ObjectSetError(
            f"{path} cannot be read ({error}), expected a JSON object; delete {folder} and import the meshes again"
        ) from error
    return _parse(path, content)


def _parse(path: Path, content: Any) -> Manifest:
    if not isinstance(content, dict) or content.get("format") != MANIFEST_FORMAT:
        found = content.get("format") if isinstance(content, dict) else type(content).__name__
        raise ObjectSetError(
            f"{path} has format {shown(found)}, expected {MANIFEST_FORMAT}; delete its folder and import the meshes "
            "again with this version"
        )
    try:
        manifest = typed(Manifest, _without_news(content))
        faults = [fault for entry in manifest.objects for fault in _impossible(entry)]
        if faults:
            raise HeaderError(listed(faults))
    except HeaderError as error:
        raise ObjectSetError(f"{path} is damaged: {error}; delete its folder and import the meshes again") from error
    return manifest


def _without_news(content: dict[str, Any]) -> dict[str, Any]:
    """What this version knows of a manifest: a later one of the same format may say more."""
    known = {field.name for field in fields(ObjectEntry)}
    manifest = {field.name: content[field.name] for field in fields(Manifest) if field.name in content}
    entries = manifest.get("objects")
    if isinstance(entries, list):
        manifest["objects"] = [
            {key: value for key, value in entry.items() if key in known} if isinstance(entry, dict) else entry
            for entry in entries
        ]
    return manifest


def _impossible(entry: ObjectEntry) -> Iterator[str]:
    """What no object has, of an entry whose types are right."""
    lengths = {f"size_m[{at}]": extent for at, extent in enumerate(entry.size_m)}
    for key, value in {"scale": entry.scale, "mass_kg": entry.mass_kg, **lengths}.items():
        if not 0 < value < math.inf:
            yield f"{key} of object {shown(entry.name)} is {shown(value)}, expected a positive number"
    if len(lengths) != 3:
        yield f"size_m of object {shown(entry.name)} has {len(entry.size_m)} numbers, expected 3"
    if not entry.name or Path(entry.name).name != entry.name or "\0" in entry.name:
        yield f"an object is called {shown(entry.name)}, expected the name of a folder"


def load_models(folder: Path, *, splits: Iterable[str] | None = None) -> tuple[ObjectModel, ...]:
    """The objects of a set on disk in the order of its manifest, each checked against its hash.

    Raises:
        ObjectSetError: No usable manifest, or objects that are missing or changed.
    """
    manifest = read_manifest(folder)
    wanted = None if splits is None else set(splits)
    entries = [entry for entry in manifest.objects if wanted is None or entry.split in wanted]
    faults = [fault for entry in entries for fault in _faults(folder, entry)]
    if faults:
        raise ObjectSetError(
            f"object set {folder} is damaged: {'; '.join(faults)}. Delete the folder and make the set again"
        )
    return _models(folder, manifest.name, entries)


def _models(folder: Path, name: str, entries: Sequence[ObjectEntry]) -> tuple[ObjectModel, ...]:
    return tuple(
        ObjectModel(object_id=f"{name}/{entry.name}", urdf=folder / entry.name / URDF_FILE, scale=1.0)
        for entry in entries
    )


def _faults(folder: Path, entry: ObjectEntry) -> list[str]:
    place = folder / entry.name
    if not (place / URDF_FILE).is_file():
        return [f"{entry.name}/{URDF_FILE} is missing"]
    found = folder_digest(place)
    if found != entry.sha256:
        return [f"{entry.name} has SHA-256 {found[:12]}…, expected {entry.sha256[:12]}…"]
    return []
