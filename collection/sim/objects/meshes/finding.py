"""Which files of a folder are meshes, and what the objects made of them are called."""

from __future__ import annotations

import unicodedata
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from handsight.collection.sim.objects.manifest import MANIFEST_FILE
from handsight.collection.sim.objects.meshes.fault import MeshFault, shown

SUFFIXES = (".glb", ".obj", ".ply", ".stl")
MAX_NAME_BYTES = 200
"""Names become folders, which file systems limit to 255 bytes."""


def find_meshes(folder: Path, pattern: str) -> list[Path]:
    """Mesh files below ``folder`` that match ``pattern``, in the order of their paths.

    Links that lead nowhere are among them, so that they are reported. Hidden files are not: archives packed on a Mac
    hold a ``._mug.obj`` beside every ``mug.obj``.

    Raises:
        ValueError: ``pattern`` is none.
    """
    if any("**" in step and step != "**" for step in Path(pattern).parts):
        # From Python 3.13 on it would mean the same as a single star.
        raise ValueError("'**' can only be an entire path component")
    return sorted(
        path
        for path in folder.glob(pattern)
        if path.suffix.lower() in SUFFIXES
        and not any(step.startswith(".") for step in path.relative_to(folder).parts)
        and (path.is_file() or not path.exists())
    )


def other_files(folder: Path) -> str:
    """The kinds of file that lie below ``folder``, most frequent first, for a message."""
    kinds = Counter(path.suffix.lower() for path in folder.rglob("*") if path.suffix and path.is_file())
    return shown(", ".join(f"{count} {kind}" for kind, count in kinds.most_common(5))) or "no files"


def check_place(folder: Path, path: Path) -> None:
    """Refuse files outside ``folder`` and names that no manifest could hold.

    Raises:
        MeshFault: With the reason.
    """
    if not path.exists():
        raise MeshFault("is a link that leads nowhere; restore the file, or delete the link")
    if not path.resolve().is_relative_to(folder.resolve()):
        raise MeshFault(f"is a link out of the folder, to {shown(path.resolve())}; copy the file into the folder")
    try:
        str(path).encode()
    except UnicodeEncodeError as error:
        raise MeshFault("has a name that is not UTF-8; rename it") from error


def object_names(folder: Path, paths: Sequence[Path]) -> list[str]:
    """A name for each mesh: its path below ``folder``, without what all paths have in common.

    ``025_mug/google_16k/textured.obj`` among other objects of YCB becomes ``025_mug``, and
    ``Amicelli/Amicelli_5k_tex.obj`` among other objects of KIT ``Amicelli_5k_tex``.
    """
    routes = [path.relative_to(folder).with_suffix("").parts for path in paths]
    alike = len({len(route) for route in routes}) == 1 and len(routes) > 1
    kept = [
        [step for depth, step in enumerate(route) if not alike or len({other[depth] for other in routes}) > 1]
        for route in routes
    ]
    kept = [steps or [route[-1]] for steps, route in zip(kept, routes, strict=True)]
    return ["-".join(_plain(step) for step in _without_repeats(steps)) for steps in kept]


def _without_repeats(steps: Sequence[str]) -> list[str]:
    """Leave out folders whose name the next step begins with."""
    pairs = zip(steps, [*steps[1:], None], strict=True)
    return [step for step, following in pairs if following is None or not following.startswith(step)]


def _plain(step: str) -> str:
    # Anything but plain characters would have to be escaped in URDF and on the command line.
    return "".join(c if c.isalnum() or c in "._" else "-" for c in unicodedata.normalize("NFC", step))


def check_name(name: str, taken_by: str | None) -> None:
    """Refuse a name that a folder cannot have, or that another object of the set has.

    Raises:
        MeshFault: With the reason.
    """
    if taken_by is not None:
        raise MeshFault(
            f"gives object {name!r} a second time, after {shown(taken_by)}; rename one of them, or choose one kind of "
            "file with --pattern"
        )
    if len(name.encode()) > MAX_NAME_BYTES:
        raise MeshFault(f"gives an object name of {len(name.encode())} bytes, expected at most {MAX_NAME_BYTES}")
    if name == MANIFEST_FILE:
        raise MeshFault(f"gives object {name!r}, which is the name of the set's own manifest; rename it")
