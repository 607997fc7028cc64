"""The text of a Wavefront material library: colours, and pictures with the options that legally stand before them."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

from handsight.collection.sim.objects.meshes.fault import MeshFault, shown

Pair = tuple[float, float]
_SWITCHES = ("-blendu", "-blendv", "-cc", "-clamp")
_VALUES = {"-boost": 1, "-bm": 1, "-imfchan": 1, "-mm": 2, "-texres": 1, "-type": 1}
_TRIPLES = ("-s", "-o", "-t")
"""One to three numbers each: scale, offset and turbulence along u, v and w."""
_OTHER_COLOURS = ("spectral", "xyz")


@dataclass(frozen=True, slots=True, kw_only=True)
class Material:
    """What is drawn of a material."""

    colour: tuple[float, float, float] | None = None
    picture: str = ""
    """The file's name as it stands in the library; empty where there is none."""
    repeat: Pair = (1.0, 1.0)
    """By which texture coordinates are multiplied, along u and v."""
    offset: Pair = (0.0, 0.0)
    """Which is added to texture coordinates then."""


def read_mtl(content: bytes) -> dict[str, Material]:
    """The materials of a library by their names.

    Raises:
        MeshFault: A statement that would be drawn makes no sense; names the line.
    """
    materials: dict[str, Material] = {}
    name = ""
    for number, line in enumerate(content.decode("utf-8-sig", errors="surrogateescape").splitlines(), start=1):
        words = line.split()
        if len(words) < 2:
            continue
        keyword = words[0].lower()
        try:
            if keyword == "newmtl":
                name = " ".join(words[1:])
                materials[name] = Material()
            elif keyword == "kd" and name and words[1].lower() not in _OTHER_COLOURS:
                materials[name] = replace(materials[name], colour=_colour(words[1:]))
            elif keyword == "map_kd" and name:
                materials[name] = _textured(materials[name], line.split(maxsplit=1)[1].strip())
        except MeshFault as fault:
            raise MeshFault(f"line {number}: {fault}") from None
    return materials


def _colour(words: Sequence[str]) -> tuple[float, float, float]:
    values = [_number(word, "Kd") for word in words[:3]]
    if len(values) == 2:
        raise MeshFault("Kd has 2 numbers, expected red, green and blue")
    red, green, blue = (min(max(value, 0.0), 1.0) for value in values * (3 // len(values)))
    return red, green, blue


def _textured(material: Material, statement: str) -> Material:
    """The material with the picture that a ``map_Kd`` names, after whatever options."""
    rest, numbers = statement, {"-s": (1.0, 1.0), "-o": (0.0, 0.0), "-t": (0.0, 0.0)}
    while (option := rest.split(maxsplit=1)[0].lower()) in (*_SWITCHES, *_VALUES, *_TRIPLES):
        words = rest.split()
        taken = _taken(option, words)
        if len(words) <= 1 + taken:
            raise MeshFault(f"map_Kd {shown(statement)[:60]!r} names no file after its options")
        if option in _TRIPLES:
            given = [_number(word, f"map_Kd {option}") for word in words[1 : 1 + taken]]
            default = numbers[option]
            numbers[option] = (given[0], given[1] if len(given) > 1 else default[1])
        rest = rest.split(maxsplit=1 + taken)[1 + taken]
    if len(rest) > 2 and rest[0] == rest[-1] and rest[0] in "\"'":
        rest = rest[1:-1]
    return replace(material, picture=rest, repeat=numbers["-s"], offset=numbers["-o"])


def _taken(option: str, words: Sequence[str]) -> int:
    """How many of the words after an option belong to it."""
    if option in _SWITCHES:
        return 1 if len(words) > 1 and words[1].lower() in ("on", "off") else 0
    if option in _VALUES:
        return _VALUES[option]
    # The last word is the file's, even where it looks like a number.
    numbers = [bool(_NUMBER.fullmatch(word)) for word in words[1:-1][:3]]
    count = [*numbers, False].index(False)
    if not count:
        raise MeshFault(f"map_Kd has option {option} with {shown(words[1])[:40] if len(words) > 1 else 'nothing'!r}")
    return count


_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")


def _number(word: str, what: str) -> float:
    value = float(word) if _NUMBER.fullmatch(word) else math.nan
    if not math.isfinite(value):
        raise MeshFault(f"{what} holds {shown(word)[:40]!r}, expected a finite number")
    return value
