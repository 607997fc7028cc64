"""Packets of the Real-Time Data Exchange (RTDE), protocol version 2: big-endian, a length, a type, a body.

Types of variables are those of Universal Robots' guide to RTDE; strings of ``struct`` stand for them here.
"""

from __future__ import annotations

import asyncio
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

PROTOCOL_VERSION = 2
HEADER = struct.Struct(">HB")

REQUEST_PROTOCOL_VERSION = 86  # V
GET_URCONTROL_VERSION = 118  # v
TEXT_MESSAGE = 77  # M
DATA_PACKAGE = 85  # U
SETUP_OUTPUTS = 79  # O
SETUP_INPUTS = 73  # I
START = 83  # S
PAUSE = 80  # P

FORMATS: Mapping[str, str] = {
    "BOOL": "?",
    "UINT8": "B",
    "UINT32": "I",
    "UINT64": "Q",
    "INT32": "i",
    "DOUBLE": "d",
    "VECTOR3D": "3d",
    "VECTOR6D": "6d",
    "VECTOR6INT32": "6i",
    "VECTOR6UINT32": "6I",
}
NOT_FOUND = "NOT_FOUND"
IN_USE = "IN_USE"


def packet(kind: int, body: bytes = b"") -> bytes:
    """One packet with its header."""
    return HEADER.pack(HEADER.size + len(body), kind) + body


async def read_packet(reader: asyncio.StreamReader) -> tuple[int, bytes]:
    """Type and body of the next packet.

    Raises:
        asyncio.IncompleteReadError: The connection ended.
        ValueError: The length is shorter than a header.
    """
    length, kind = HEADER.unpack(await reader.readexactly(HEADER.size))
    if length < HEADER.size:
        raise ValueError(f"an RTDE packet says that it has {length} bytes, expected at least {HEADER.size}")
    return kind, await reader.readexactly(length - HEADER.size)


@dataclass(frozen=True, slots=True)
class Recipe:
    """The variables of one kind of data package, in order."""

    number: int
    names: tuple[str, ...]
    types: tuple[str, ...]
    layout: struct.Struct

    @classmethod
    def of(cls, number: int, names: Sequence[str], types: Sequence[str]) -> Recipe:
        """A recipe whose types are all known."""
        return cls(number, tuple(names), tuple(types), struct.Struct(">" + "".join(FORMATS[kind] for kind in types)))

    def pack(self, values: Mapping[str, Any]) -> bytes:
        """The data package with these values; those of vectors are sequences."""
        flat: list[Any] = []
        for name, kind in zip(self.names, self.types, strict=True):
            value = values[name]
            if kind.startswith("VECTOR"):
                flat.extend(value)
            else:
                flat.append(value)
        return packet(DATA_PACKAGE, bytes([self.number]) + self.layout.pack(*flat))

    def unpack(self, body: bytes) -> dict[str, Any]:
        """The values of a data package's body, recipe number left out; of vectors as tuples.

        Raises:
            ValueError: The body is shorter or longer than the recipe's variables, as one of five pose numbers is.
        """
        if len(body) != self.layout.size:
            raise ValueError(f"recipe {self.number} has {self.layout.size} bytes, got {len(body)}")
        flat = self.layout.unpack(body)
        values: dict[str, Any] = {}
        at = 0
        for name, kind in zip(self.names, self.types, strict=True):
            if kind.startswith("VECTOR"):
                width = int(kind[len("VECTOR")])
                values[name] = flat[at : at + width]
                at += width
            else:
                values[name] = flat[at]
                at += 1
        return values
