"""What a binary glTF file declares, checked before anything is allocated for it."""

from __future__ import annotations

import base64
import json
import struct
from collections.abc import Iterator
from typing import Any

from handsight.collection.sim.objects.meshes.companions import check_picture
from handsight.collection.sim.objects.meshes.fault import MeshFault

MAX_VALUES = 1_000_000
"""Rows of an accessor: more than three corners of each triangle that an object may have."""
MAX_ALL_VALUES = 10_000_000
"""Rows of all accessors together."""
MAX_NODES = 2_000
"""Readers look for the way to each node anew."""
_HEADER = struct.Struct("<4sIIII")
_CHUNK = struct.Struct("<II")
_DATA = "base64,"


def check_glb(content: bytes, *, textures: bool) -> None:
    """Refuse files whose header asks for absurd amounts of memory, or whose own pictures cannot be used.

    Args:
        content: the file.
        textures: whether its pictures matter.

    Raises:
        MeshFault: With the reason.
    """
    try:
        tree, binary = _chunks(content)
        _check_accessors(tree)
        _check_nodes(tree.get("nodes", []))
        pictures = list(_pictures(tree, binary)) if textures else []
    except (ValueError, TypeError, LookupError, AttributeError, RecursionError, struct.error) as error:
        raise MeshFault(f"cannot be read, its description makes no sense ({type(error).__name__})") from error
    for number, picture in enumerate(pictures):
        try:
            check_picture(picture)
        except MeshFault as fault:
            raise MeshFault(f"its picture {number} {fault}; repair it, or pass --plain to do without looks") from fault


def _chunks(content: bytes) -> tuple[dict[str, Any], bytes]:
    """The description, and the binary chunk, empty where there is none."""
    if content[:4] != b"glTF":
        raise MeshFault("cannot be read, it is no binary glTF file")
    start = _HEADER.size + _HEADER.unpack_from(content)[3]
    tree = json.loads(content[_HEADER.size : start])
    if len(content) < start + _CHUNK.size:
        return tree, b""
    size = _CHUNK.unpack_from(content, start)[0]
    return tree, content[start + _CHUNK.size : start + _CHUNK.size + size]


def _check_accessors(tree: dict[str, Any]) -> None:
    for accessor in tree.get("accessors", []):
        if not 0 <= accessor["count"] <= MAX_VALUES:
            raise MeshFault(f"declares an accessor of {accessor['count']} rows, expected at most {MAX_VALUES}")
    total = sum(accessor["count"] for accessor in tree.get("accessors", []))
    if total > MAX_ALL_VALUES:
        raise MeshFault(f"declares accessors of {total} rows together, expected at most {MAX_ALL_VALUES}; decimate it")


def _check_nodes(nodes: list[dict[str, Any]]) -> None:
    """Nodes form trees: each has at most one parent, and no loop leads back to it. Readers follow loops for ever."""
    if len(nodes) > MAX_NODES:
        raise MeshFault(f"has {len(nodes)} nodes, expected at most {MAX_NODES}; unite them")
    parents: dict[int, int] = {}
    for number, node in enumerate(nodes):
        for child in node.get("children", []):
            if parents.setdefault(child, number) != number or not 0 <= child < len(nodes):
                raise MeshFault("cannot be read, its nodes form no tree")
    ahead = [number for number in range(len(nodes)) if number not in parents]
    reached = 0
    while ahead:
        ahead += nodes[ahead.pop()].get("children", [])
        reached += 1
    if reached != len(nodes):
        raise MeshFault("cannot be read, its nodes form no tree")


def _pictures(tree: dict[str, Any], binary: bytes) -> Iterator[bytes]:
    """The pictures that the file itself holds."""
    for image in tree.get("images", []):
        if "bufferView" in image:
            view = tree["bufferViews"][image["bufferView"]]
            if "uri" not in tree["buffers"][view["buffer"]]:
                start = view.get("byteOffset", 0)
                yield binary[start : start + view["byteLength"]]
        elif _DATA in image["uri"]:
            yield base64.b64decode(image["uri"].partition(_DATA)[2])
