"""Meshes good and bad, as the bytes of their files, and what a refused import says."""

from __future__ import annotations

import json
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from handsight.cli.app import run
from handsight.collection.sim.objects.cache import cache_root


def block(side_m: float = 0.05, x_m: float = 0.0) -> trimesh.Trimesh:
    """A cube; CoACD is done with it at once."""
    cube: trimesh.Trimesh = trimesh.creation.box(extents=(side_m,) * 3)
    cube.apply_translation((x_m, 0, 0))
    return cube


def inverted(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    mesh.invert()
    return mesh


def row_of_blocks(count: int) -> trimesh.Trimesh:
    """Cubes so close that they count as touching."""
    row = block(0.02)
    for number in range(1, count):
        row += block(0.02, x_m=0.0205 * number)
    return row


def stl(mesh: trimesh.Trimesh) -> bytes:
    content = mesh.export(file_type="stl")
    assert isinstance(content, bytes)
    return content


def pyramid(library: str = "", *, last_uv: str = "0 1", last_corner: str = "4/3") -> bytes:
    """A closed Wavefront file with texture coordinates."""
    corners = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\n"
    coordinates = f"vt 0 0\nvt 1 0\nvt {last_uv}\n"
    faces = f"usemtl m\nf 1/1 3/2 2/3\nf 1/1 2/2 4/3\nf 2/1 3/2 {last_corner}\nf 1/1 4/2 3/3\n"
    return (f"mtllib {library}\n" * bool(library) + corners + coordinates + faces).encode()


def png(width: int, height: int) -> bytes:
    """A picture that claims a size and holds next to nothing."""

    def chunk(kind: bytes, content: bytes) -> bytes:
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    pixels = chunk(b"IDAT", zlib.compress(bytes(1000)))
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + pixels + chunk(b"IEND", b"")


def glb(description: dict[str, Any], binary: bytes = b"") -> bytes:
    text = json.dumps(description).encode()
    text += b" " * (-len(text) % 4)
    binary += bytes(-len(binary) % 4)
    body = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(binary), 0x004E4942) + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def glb_of(**changes: Any) -> bytes:
    """One mesh of three corners, with some of the description changed."""
    accessor = {"count": 3, "componentType": 5126, "type": "VEC3", "bufferView": 0}
    description = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [accessor],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"byteLength": 36}],
    }
    return glb({**description, **changes}, bytes(36))


def refused_import(capsys: pytest.CaptureFixture[str], folder: Path, *words: str) -> list[str]:
    """The lines of a refusal, which must end with status 2 and leave the cache as it is."""
    before = sorted(cache_root().rglob("*"))
    assert run(["objects", "import", str(folder), "--name", "mine", *words]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith("error: ")
    assert sorted(cache_root().rglob("*")) == before
    return said.err.splitlines()


def cup() -> trimesh.Trimesh:
    """A closed, concave beaker: 60 mm wide, 50 mm high, walls 8 mm."""
    profile = np.array([(0, 0), (30, 0), (30, 50), (22, 50), (22, 8), (0, 8)]) * 1e-3
    solid: trimesh.Trimesh = trimesh.creation.revolve(profile, sections=16)
    return solid


def cuboid() -> trimesh.Trimesh:
    """A cuboid: cut into its one part at once, where the beaker takes seconds."""
    solid: trimesh.Trimesh = trimesh.creation.box(extents=(0.06, 0.05, 0.04))
    return solid
