"""The files that a mesh names: materials, textures, buffers. They are read from the imported folder alone."""

from __future__ import annotations

import hashlib
import io
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from PIL import Image, UnidentifiedImageError
from trimesh.resolvers import Resolver

from handsight.collection.sim.objects.meshes.fault import MeshFault, shown

MAX_COMPANION_BYTES = 200_000_000
MAX_TEXTURE_PIXELS = 8192 * 8192
"""A picture of a few kilobytes can claim to be larger than memory."""
_PICTURES = ("BMP", "GIF", "JPEG", "PNG", "TGA", "TIFF", "WEBP")
"""Formats that Pillow decodes by itself; for PostScript, for example, it would start another program."""
_NOT_PICTURES = (".bin", ".mtl")
_LOOKS = (".bmp", ".gif", ".jpeg", ".jpg", ".mtl", ".png", ".tga", ".tif", ".tiff", ".webp")


class Companions(Resolver):
    """Hands trimesh the files that a mesh names, and remembers what it could not hand out.

    trimesh leaves a texture out without a word when it cannot be read. Here every such file is a fault: an object
    that has lost its looks teaches a network the wrong thing.
    """

    def __init__(self, mesh: Path, root: Path) -> None:
        """Files named by ``mesh``, which must lie below ``root``."""
        self._folder = mesh.parent
        self._root = root.resolve()
        self.file_name = mesh.name
        self.faults: list[str] = []
        self.sha256: dict[Path, str] = {}
        """Of every file handed out, by its path."""
        self.stand_ins: dict[str, bytes] = {}
        """Contents that are handed out under names of their own, without looking for a file."""

    def get(self, key: str) -> bytes:
        """The content of a file.

        Raises:
            FileNotFoundError: It cannot be used; the reason is among the faults.
        """
        if key in self.stand_ins:
            return self.stand_ins[key]
        try:
            path = self._locate(key)
            content = path.read_bytes()
            if path.suffix.lower() not in _NOT_PICTURES:
                check_picture(content)
        except (MeshFault, OSError, ValueError) as error:
            # Names with a zero byte are a ValueError.
            reason = error.strerror if isinstance(error, OSError) else str(error)
            self.faults.append(f"names {shown(key.strip())!r}, which {reason}")
            raise FileNotFoundError(key) from error
        self.sha256[path] = hashlib.sha256(content).hexdigest()
        return content

    def _locate(self, key: str) -> Path:
        # Collections made on Windows separate folders by backslashes.
        name = key.strip().replace("\\", "/")
        path = self._folder / name
        # Not Path.resolve, which says of links that lead in circles what depends on the version of Python.
        real = Path(os.path.realpath(path))
        if re.match(r"[A-Za-z][A-Za-z0-9+.-]*:", name) or not real.is_relative_to(self._root):
            raise MeshFault(f"is outside the folder{self._remedy(name, real)}")
        if not path.is_file():
            raise MeshFault("is a link that leads nowhere" if path.is_symlink() else "is missing")
        if path.stat().st_size > MAX_COMPANION_BYTES:
            raise MeshFault(f"has more than {MAX_COMPANION_BYTES / 1e6:.0f} MB")
        return path

    def has(self, key: str) -> bool:
        """Whether there is a file of that name, in the folder or not."""
        try:
            return (self._folder / key.strip().replace("\\", "/")).is_file()
        except (OSError, ValueError):
            return False

    def _remedy(self, name: str, real: Path) -> str:
        """How a collection that keeps its pictures in a folder above can be imported; empty where it is none."""
        relative = not Path(name).is_absolute() and real.suffix.lower() in _LOOKS and real.is_file()
        parent = Path(os.path.commonpath([real, self._root]))
        if not relative or parent == parent.parent:
            return ""
        pattern = f"{self._root.relative_to(parent).as_posix()}/**/*"
        return f" (to take it in, import {shown(parent)} with --pattern '{shown(pattern)}')"

    def check(self) -> None:
        """Refuse the mesh when a file that it names could not be used.

        Raises:
            MeshFault: Names every such file.
        """
        if self.faults:
            faults = "; ".join(dict.fromkeys(self.faults))
            raise MeshFault(f"{faults}. Put that right, or pass --plain to do without looks")

    def keys(self) -> Iterator[str]:
        """Nothing is listed: a mesh names what it needs."""
        return iter(())

    def namespaced(self, namespace: str) -> Resolver:
        """Refused: no mesh format that is read here has archives within."""
        raise NotImplementedError(f"namespace {namespace!r} of {self.file_name}")

    def write(self, name: str, data: Any) -> None:
        """Refused: an import changes nothing in the folder that it reads."""
        raise PermissionError(f"{name} beside {self.file_name}, {len(data)} bytes")


def check_picture(content: bytes) -> None:
    """Decode a texture.

    Raises:
        MeshFault: It is no picture, cut off, or too large.
    """
    try:
        with Image.open(io.BytesIO(content), formats=_PICTURES) as picture:
            width, height = picture.size
            if width * height > MAX_TEXTURE_PIXELS:
                raise MeshFault(f"is a picture of {width} x {height} pixels, expected at most 8192 x 8192")
            picture.load()
    except MeshFault:
        raise
    except UnidentifiedImageError as error:
        raise MeshFault(f"is no picture of kind {', '.join(_PICTURES)}") from error
    except (Image.DecompressionBombError, Image.DecompressionBombWarning) as error:
        raise MeshFault("is a picture of far more than 8192 x 8192 pixels") from error
    except Exception as error:
        # Pillow's readers raise whatever a broken file leads them into.
        raise MeshFault(f"is a picture that cannot be read ({type(error).__name__}: {shown(str(error))})") from error
