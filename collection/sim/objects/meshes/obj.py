"""The text of a Wavefront file, every line checked, and written anew in the plainest form that readers agree on.

Readers differ in what they make of legal files (relative corners, tabs, several material libraries) and leave out, or
read as something else, what they do not understand. What is handed on holds vertices, texture coordinates, normals,
materials and faces, and numbers as they stood in the file.
"""

from __future__ import annotations

import io
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from handsight.collection.sim.objects.meshes.fault import MAX_TRIANGLES, MeshFault, shown
from handsight.datasets.errors import counted

LIBRARY = "materials.mtl"
"""The one material library that the text written anew names."""
MAX_ROWS = 500_000
"""Vertices, coordinates or normals: more than three for each triangle that an object may have."""
MAX_LINES = 4_000_000
MAX_CORNERS = 1_000
"""Of one face; readers cut it into triangles."""
_INTEGER = re.compile(r"[+-]?[0-9]{1,15}")
_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eEdD][+-]?[0-9]+)?|[+-]?(nan|inf|infinity)", re.IGNORECASE)
_ROWS = {"v": ("vertex", 3), "vt": ("texture coordinate", 1), "vn": ("normal", 3)}
_COLOURED = 6
"""Numbers of a vertex with its colour."""

_QUADRANGLE = 4

Corner = tuple[int, int, int]
"""Vertex, texture coordinate and normal, counted from 1; 0 where there is none."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WavefrontText:
    """A file that can be read."""

    text: str
    """Names :data:`LIBRARY` where the file names libraries of its own."""
    libraries: tuple[str, ...]
    """The material libraries that it names, in their order."""
    materials: tuple[str, ...]
    """The materials that it names; the text calls them by their places here, see :func:`material_name`."""


@dataclass(slots=True)
class _Contents:
    """What the lines read so far say."""

    rows: dict[str, list[str]] = field(default_factory=lambda: {kind: [] for kind in _ROWS})
    coloured: int = 0
    """Vertices that bring a colour."""
    faces: list[tuple[int, list[Corner]] | str] = field(default_factory=list)
    """Line number and corners of each face, and the names of materials in between."""
    triangles: int = 0
    libraries: list[str] = field(default_factory=list)
    loose: str = ""
    """Why coordinates and normals cannot be used; they are looks, and an import may do without."""


def read_obj(content: bytes, *, plain: bool) -> WavefrontText:
    """Check the text of a Wavefront file.

    Args:
        content: the file.
        plain: leave out materials, and texture coordinates and normals that make no sense.

    Raises:
        MeshFault: Names the line.
    """
    contents = _Contents()
    for number, words in _lines(content):
        try:
            _take(contents, number, words)
        except MeshFault as fault:
            raise MeshFault(f"line {number}: {fault}") from None
    _check_corners(contents)
    if contents.loose and not plain:
        raise MeshFault(f"{contents.loose}; pass --plain to do without looks")
    return WavefrontText(
        text="\n".join(_written(contents, plain=plain)) + "\n",
        libraries=() if plain else tuple(dict.fromkeys(contents.libraries)),
        materials=() if plain else tuple(_materials(contents)),
    )


def _lines(content: bytes) -> Iterator[tuple[int, list[str]]]:
    """Number and words of each line that says something; lines that end in a backslash go on in the next one."""
    begun, first = "", 0
    for number, line in enumerate(io.TextIOWrapper(io.BytesIO(content), "utf-8-sig", "surrogateescape"), start=1):
        if number > MAX_LINES:
            raise MeshFault(f"has more than {MAX_LINES} lines; decimate it")
        first = first if begun else number
        line = line.rstrip("\n")
        if line.endswith("\\"):
            begun += line[:-1] + " "
            continue
        words, begun = (begun + line).split(), ""
        if words and words[0] != "mtllib":
            words = " ".join(words).partition("#")[0].split()
        if words:
            yield first, words
    if begun.split():
        yield first, begun.split()


def _take(contents: _Contents, number: int, words: Sequence[str]) -> None:
    keyword, values = words[0], words[1:]
    if keyword in _ROWS:
        _take_row(contents, number, keyword, values)
    elif keyword in ("f", "fo"):
        if contents.triangles > MAX_TRIANGLES:
            raise MeshFault(f"has more than {MAX_TRIANGLES} triangles; decimate it")
        corners = _corners(contents, number, values)
        contents.triangles += len(corners) - 2
        contents.faces.append((number, corners))
    elif keyword == "usemtl":
        contents.faces.append(" ".join(values))
    elif keyword == "mtllib" and values:
        contents.libraries.append(" ".join(values))


def _take_row(contents: _Contents, number: int, keyword: str, values: Sequence[str]) -> None:
    what, least = _ROWS[keyword]
    rows = contents.rows[keyword]
    if len(rows) >= MAX_ROWS:
        raise MeshFault(f"is {what} {MAX_ROWS + 1}, expected at most {MAX_ROWS}; decimate the mesh")
    try:
        if len(values) < least:
            raise MeshFault(f"a {what} has {counted(len(values), 'number')}, expected {least}")
        numbers = [_number(value, what) for value in values[:_COLOURED]]
    except MeshFault as fault:
        if keyword == "v":
            raise
        # A row that is no use still counts: faces name the others by their places.
        numbers = ["0"] * least
        contents.loose = contents.loose or f"line {number}: {fault}"
    if keyword == "vt":
        # A line of a picture has but one coordinate, and a solid texture three.
        numbers = [*numbers, "0"][:2]
    contents.coloured += keyword == "v" and len(numbers) == _COLOURED
    rows.append(" ".join(numbers))


def _number(text: str, what: str) -> str:
    if not _NUMBER.fullmatch(text):
        raise MeshFault(f"a {what} holds {shown(text)[:40]!r}, expected a number")
    # Fortran writes exponents with a D.
    value = text.lower().replace("d", "e") if text[-1] in "0123456789." else text
    if not math.isfinite(float(value)):
        raise MeshFault(f"a {what} holds {shown(text)[:40]!r}, expected a finite number; repair or leave out the mesh")
    return value


def _corners(contents: _Contents, number: int, values: Sequence[str]) -> list[Corner]:
    if not 3 <= len(values) <= MAX_CORNERS:
        raise MeshFault(f"a face has {counted(len(values), 'corner')}, expected 3 to {MAX_CORNERS}")
    corners = []
    for value in values:
        vertex, *others = value.split("/")
        if len(others) > 2:
            raise MeshFault(f"a face has corner {shown(value)[:40]!r}, expected VERTEX/COORDINATE/NORMAL")
        places = [_place(contents, "v", vertex)]
        for kind, other in zip(("vt", "vn"), [*others, "", ""], strict=False):
            try:
                places.append(_place(contents, kind, other) if other else 0)
            except MeshFault as fault:
                places.append(0)
                contents.loose = contents.loose or f"line {number}: {fault}"
        corners.append((places[0], places[1], places[2]))
    return corners


def _place(contents: _Contents, kind: str, text: str) -> int:
    """A place counted from 1; those given from the end are relative to what stands above the face."""
    what = _ROWS[kind][0]
    above = len(contents.rows[kind])
    if not _INTEGER.fullmatch(text):
        raise MeshFault(f"a face names {what} {shown(text)[:40]!r}, expected a whole number")
    place = int(text)
    if place == 0 or place < -above:
        raise MeshFault(f"a face names {what} {place}, expected 1 and more, or -{above} to -1 of those above it")
    return place if place > 0 else above + 1 + place


def _check_corners(contents: _Contents) -> None:
    """Faces may name what stands below them, so that only the whole file tells whether it is there."""
    there = tuple(len(contents.rows[kind]) for kind in _ROWS)
    for face in contents.faces:
        if isinstance(face, str):
            continue
        number, corners = face
        for kind, count, most in zip(_ROWS, there, map(max, zip(*corners, strict=True)), strict=True):
            if most <= count:
                continue
            fault = f"line {number}: a face names {_ROWS[kind][0]} {most}, and the file has {count}"
            if kind == "v":
                raise MeshFault(fault)
            contents.loose = contents.loose or fault


def _written(contents: _Contents, *, plain: bool) -> Iterator[str]:
    if contents.libraries and not plain:
        yield f"mtllib {LIBRARY}"
    vertices = contents.rows["v"]
    if not plain and contents.coloured == len(vertices):
        yield from (f"v {row}" for row in vertices)
    else:
        yield from (f"v {' '.join(row.split()[:3])}" for row in vertices)
    if not contents.loose:
        yield from (f"vt {row}" for row in contents.rows["vt"])
        yield from (f"vn {' '.join(row.split()[:3])}" for row in contents.rows["vn"])
    blocks = _blocks(contents)
    numbers = {material: number for number, material in enumerate(_materials(contents))}
    for material, faces in blocks:
        if material is not None and not plain:
            yield f"usemtl {material_name(numbers[material])}"
        for face in faces:
            yield from _face_lines(face)


def material_name(number: int) -> str:
    """What the text written anew calls a material: names of files may hold what a reader takes for something else."""
    return f"material_{number}"


def _materials(contents: _Contents) -> list[str]:
    return list(dict.fromkeys(face for face in contents.faces if isinstance(face, str)))


def _blocks(contents: _Contents) -> list[tuple[str | None, list[list[Corner]]]]:
    """Faces by the material that stands above them, with coordinates and normals where all faces of it have them.

    Readers take the first face of a material for all of it.
    """
    blocks: list[tuple[str | None, list[list[Corner]]]] = [(None, [])]
    lacking: dict[str | None, tuple[bool, bool]] = {}
    for face in contents.faces:
        if isinstance(face, str):
            blocks.append((face, []))
            continue
        material, faces = blocks[-1]
        faces.append(face[1])
        _, coordinates, normals = zip(*face[1], strict=True)
        before = lacking.get(material, (bool(contents.loose), bool(contents.loose)))
        lacking[material] = (before[0] or 0 in coordinates, before[1] or 0 in normals)
    return [(material, [_alike(face, *lacking[material]) for face in faces]) for material, faces in blocks if faces]


def _alike(face: list[Corner], lacks_coordinates: bool, lacks_normals: bool) -> list[Corner]:
    return [(v, 0 if lacks_coordinates else vt, 0 if lacks_normals else vn) for v, vt, vn in face]


def _face_lines(face: list[Corner]) -> Iterator[str]:
    """One line for a triangle or quadrangle, a fan of triangles for others."""
    fans = [face] if len(face) <= _QUADRANGLE else [[face[0], face[i], face[i + 1]] for i in range(1, len(face) - 1)]
    return ("f " + " ".join(_joined(corner) for corner in fan) for fan in fans)


def _joined(corner: Corner) -> str:
    vertex, coordinate, normal = corner
    if not normal:
        return f"{vertex}/{coordinate}" if coordinate else str(vertex)
    return f"{vertex}/{coordinate or ''}/{normal}"
