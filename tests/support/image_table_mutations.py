"""Changes to a table of pictures beside those of every kind of file: odd cells and paths, and PNGs that claim things.

Every function takes a generator, so that an input that failed comes back from its seed.
"""

from __future__ import annotations

import csv
import io
import json
import struct
import zlib
from pathlib import Path

import numpy as np
from tests.support.fuzz_mutations import mutate_bytes, mutate_json

ODD_CELLS = (
    "",
    " ",
    "x",
    "nan",
    "inf",
    "-inf",
    "1e400",
    "0,5",
    "1_000",
    "-1",
    "85",
    "30.0",
    "\u0661",
    "a\0b",
    "9" * 5000,
    '"',
)
ODD_PATHS = (
    "",
    ".",
    "..",
    "/etc/passwd",
    "a" * 300,
    "a\0b",
    "f",
    "attempts.csv",
    "station.json",
    "../x.png",
    "\ud800.png",
)


def mutated_text(text: str, rng: np.random.Generator) -> bytes:
    """A text file in another encoding, with other line ends, nested without end, or as damaged bytes."""
    match rng.integers(8):
        case 0:
            return text.encode("utf-16")
        case 1:
            return text.replace("\n", "\r").encode()
        case 2:
            return b"\xef\xbb\xbf" + text.encode()
        case 3:
            return b"[" * 200_000 + text.encode()
        case 4:
            return (text + text).encode()
        case _:
            return mutate_bytes(text.encode(), rng)


def mutated_csv(text: str, rng: np.random.Generator) -> bytes:
    """A table with an odd cell, row, column or separator, or damaged as any text."""
    rows = list(csv.reader(io.StringIO(text)))
    row, column = int(rng.integers(len(rows))), int(rng.integers(len(rows[0])))
    match rng.integers(9):
        case 0 | 1 | 2:
            odd = (*ODD_CELLS, *ODD_PATHS)
            rows[row][column] = odd[rng.integers(len(odd))]
        case 3:
            rows[0][column] = rows[0][int(rng.integers(len(rows[0])))]
        case 4:
            del rows[row][column:]
        case 5:
            rows.insert(row, [])
        case 6:
            for cells in rows:
                del cells[column]
        case 7:
            return text.replace(",", str(rng.choice([";", "\t", "|", ", "]))).encode()
        case _:
            return mutated_text(text, rng)
    written = io.StringIO()
    csv.writer(written).writerows(rows)
    return written.getvalue().encode(errors="surrogatepass")


def mutated_png(data: bytes, rng: np.random.Generator) -> bytes:
    """A PNG that claims another size or kind, with its checksum mended, or is damaged as any bytes."""
    if rng.integers(2):
        return mutate_bytes(data, rng)
    head = bytearray(data)
    match rng.integers(3):
        case 0:
            sides = [int(one) for one in rng.choice([0, 1, 64, 30_000, 200_000, 2**31 - 1], size=2)]
            head[16:24] = struct.pack(">II", *sides)
        case 1:
            head[24] = int(rng.choice([0, 1, 8, 16, 255]))
        case _:
            head[25] = int(rng.choice([0, 2, 3, 4, 6, 255]))
    head[29:33] = struct.pack(">I", zlib.crc32(bytes(head[12:29])))
    return bytes(head)


def mutate_image_table(folder: Path, rng: np.random.Generator) -> str:
    """Change one file of a folder of pictures, ``attempts.csv`` and ``station.json``; returns what was done."""
    station, table = folder / "station.json", folder / "attempts.csv"
    pictures = sorted(folder.rglob("*.png"))
    match rng.integers(6):
        case 0 | 1:
            changed = json.dumps(mutate_json(json.loads(station.read_text()), rng))
            station.write_text(changed, errors="surrogatepass")
            return f"station.json is {changed[:2000]}"
        case 2:
            data = mutated_text(station.read_text(), rng)
            station.write_bytes(data)
            return f"station.json is {data[:2000]!r}"
        case 3 | 4:
            data = mutated_csv(table.read_text(), rng)
            table.write_bytes(data)
            return f"attempts.csv is {data[:2000]!r}"
        case _:
            picture = pictures[rng.integers(len(pictures))]
            data = mutated_png(picture.read_bytes(), rng)
            picture.write_bytes(data)
            return f"{picture.name} is {data[:64]!r}"
