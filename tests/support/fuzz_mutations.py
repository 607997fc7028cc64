"""Changes that turn good input into bad: of bytes, of text, of JSON, of cells, and of whole folders."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

T = TypeVar("T")
ODD_VALUES: tuple[Any, ...] = (
    *(None, True, False, "", "x" * 5000, "\ud800", "\x00", "é\u202e\U0001f600", [], {}, [[]], {"a": 1}, [None]),
    *("text", "0.001", "a\0b", [[1]], ["a", None], 1000.0, -0.5, 10**400, 1e-300, 1e300),
    *(-1, 0, 1, 2, 85, 10**6, 10**9, 2**31, 2**63, 10**30, -(10**30), 0.5, -0.0, 1e-320, 1e308),
    *(
        float("nan"),
        float("inf"),
        float("-inf"),
        list(range(1000)),
        "1e400",
        "nan",
        "0x10",
        "1_000",
        "../../etc/passwd",
    ),
    *("0000-00-00", "9999-12-31T23:59:60", "2026-02-30T00:00:00", "10000-01-01", "2026-01-31T00:00:00+99:00"),
    *(-(2**63), 2**63 - 1, 2**64, "\u0661\u0662", "1.7976931348623157e309", {"": {"": {}}}, {"__class__": "x"}),
)
ODD_WORDS = (
    *("", " ", "0", "-1", "1", "1.5", "1e400", "nan", "inf", "-inf", "9" * 400, "99999999999999w", "0x10", "1_000"),
    *("\x00", "\x1b[31m", "é\u202e", "x" * 5000, "a b", "'", '"', "\\", "%s%n", "{0}", "[b]", "../..", "~", "~nobody"),
    *("/", "//", ".", "..", "-", "--", "@", "a@b@c", "s3://", "s3://b/g", "lab@home", "None", "true", "main", "*", "["),
)
ODD_TEXT = (
    *("(", ")" * 3, "((((", "'", '"', "\n", "\r\n", "\t", ";", ",", "\\", "\x00", "\ufeff", "é", "nan", "inf", "1e400"),
    *("-", "99999999999999999999", " == ", " and ", " or ", "not ", "[0]", "(a+)+$", "\\1", "#", "../", "0.0.0", "_"),
)
_FACTORS = (1000.0, 0.001, 100.0, -1.0, 57.3, 1e30)
"""Between units that are mistaken for one another, and beyond all of them."""


def one_of(choices: Iterable[T], rng: np.random.Generator) -> T:
    """One of some things."""
    listed = list(choices)
    return listed[int(rng.integers(len(listed)))]


def mutate_bytes(content: bytes, rng: np.random.Generator) -> bytes:
    """Flip, cut, lengthen, fill, repeat or move some bytes."""
    data = bytearray(content)
    place = int(rng.integers(len(data) + 1))
    length = int(rng.integers(1, 65))
    kind = int(rng.integers(7))
    if kind == 0:
        return bytes(data[:place])
    if kind == 1:
        return bytes(data) + rng.bytes(length * 16)
    if kind == 2:
        data[place : place + length] = rng.bytes(length)
    elif kind == 3:
        data[place : place + length] = bytes(length)
    elif kind == 4:
        other = int(rng.integers(len(data) + 1))
        data[place:place] = data[other : other + length]
    elif kind == 5:
        del data[place : place + length]
    elif data:
        for at in rng.integers(len(data), size=int(rng.integers(1, 9))).tolist():
            data[at] ^= 1 << int(rng.integers(8))
    return bytes(data)


def mutate_text(text: str, rng: np.random.Generator) -> str:
    """Put odd text in, or take words or lines out, repeat or exchange them."""
    kind = int(rng.integers(5))
    if kind == 0:
        place = int(rng.integers(len(text) + 1))
        return text[:place] + one_of(ODD_TEXT, rng) * one_of((1, 1, 1, 2, 3000), rng) + text[place:]
    if kind == 1:
        return mutate_bytes(text.encode(errors="surrogatepass"), rng).decode(errors="replace")
    separator = " " if kind == 2 else "\n"
    parts = text.split(separator)
    place, other = (int(rng.integers(len(parts))) for _ in range(2))
    change = int(rng.integers(4))
    if change == 0:
        del parts[place]
    elif change == 1:
        parts.insert(place, parts[other])
    elif change == 2:
        parts[place] = one_of(ODD_TEXT, rng)
    else:
        parts[place], parts[other] = parts[other], parts[place]
    return separator.join(parts)


def mutate_json(value: Any, rng: np.random.Generator) -> Any:
    """A tree with one branch of another type or value, missing, renamed, repeated or nested deeply."""
    if isinstance(value, dict | list) and value and rng.random() < 0.9:
        keys = list(value) if isinstance(value, dict) else list(range(len(value)))
        key = one_of(keys, rng)
        if rng.random() < 0.7:
            changed = dict(value) if isinstance(value, dict) else list(value)
            changed[key] = mutate_json(value[key], rng)
            return changed
        if isinstance(value, dict):
            rest = {name: item for name, item in value.items() if name != key}
            return rest if rng.random() < 0.6 else {**rest, one_of(ODD_WORDS, rng): value[key]}
        return value[:key] + value[key + 1 :] if rng.random() < 0.5 else [*value, value[key]]
    if rng.random() < 0.05:
        for _ in range(800):
            value = [value]
        return value
    if isinstance(value, int | float) and not isinstance(value, bool) and rng.random() < 0.3:
        return value * one_of(_FACTORS, rng)
    return one_of(ODD_VALUES, rng)


def mutate_json_text(text: str, rng: np.random.Generator) -> str:
    """The text of a tree, changed as a tree mostly, and as text now and then."""
    if rng.random() < 0.2:
        return mutate_text(text, rng)
    if rng.random() < 0.2:
        return _beyond_json(text, rng)
    try:
        return json.dumps(mutate_json(json.loads(text), rng))
    except (ValueError, RecursionError):
        # It was spoilt before.
        return mutate_text(text, rng)


_KEYS = re.compile(r'"[^"]+"\s*:')
_NUMBERS = re.compile(r"-?\d+(\.\d+)?(e-?\d+)?")
_BEYOND_NUMBERS = ("1e99999", "-1e99999", "9" * 5000, "NaN", "-Infinity", "0x10", "01", "1e-99999", "-0")


def _beyond_json(text: str, rng: np.random.Generator) -> str:
    """What no tree can say: a key that stands twice, numbers beyond all measure, nesting beyond any stack."""
    pattern = _KEYS if rng.random() < 0.5 else _NUMBERS
    found = list(pattern.finditer(text))
    if not found or rng.random() < 0.1:
        return "[" * 100_000 + text
    place = one_of(found, rng)
    if pattern is _KEYS:
        odd = json.dumps(one_of(ODD_VALUES, rng))
        return f"{text[: place.start()]}{place[0]} {odd}, {text[place.start() :]}"
    return text[: place.start()] + one_of(_BEYOND_NUMBERS, rng) + text[place.end() :]


def mutate_toml(text: str, rng: np.random.Generator) -> str:
    """A line with another value, gone, twice, or under another table; or changed as text."""
    lines = text.splitlines()
    place = int(rng.integers(len(lines)))
    key, equals, value = lines[place].partition("=")
    kind = int(rng.integers(6))
    if kind <= 1 and equals:
        values = ("true", "-1", "1e400", "inf", "nan", "9" * 400, '""', '"\\u0000"', "[]", "[[]]", "{}", "1979-05-27")
        chosen = one_of((*values, "[" * 5000, "0x10", "'../x'"), rng)
        lines[place] = f"{key}= {chosen}"
    elif kind == 2:
        del lines[place]
    elif kind == 3:
        lines.insert(int(rng.integers(len(lines) + 1)), lines[place])
    elif kind == 4 and equals:
        other = one_of(("x", "a.b.c", '""', f"{key.strip()}.x"), rng)
        lines[place] = f"{other} ={value}"
    else:
        return mutate_text(text, rng)
    return "\n".join(lines) + "\n"


def mutate_cells(text: str, rng: np.random.Generator) -> str:
    """A table with a cell, a row or a column changed."""
    rows = [line.split(",") for line in text.splitlines()]
    row = one_of(rows, rng)
    kind = int(rng.integers(6))
    if kind <= 2:
        row[int(rng.integers(len(row)))] = one_of(ODD_WORDS, rng)
    elif kind == 3:
        column = int(rng.integers(len(rows[0])))
        for line in rows:
            line[column:] = line[column + 1 :] if rng.random() < 0.9 else line[column:]
    elif kind == 4:
        rows[0][int(rng.integers(len(rows[0])))] = one_of((*rows[0], *ODD_WORDS), rng)
    else:
        return mutate_text(text, rng)
    return "\n".join(",".join(line) for line in rows) + "\n"


def mutate_file(path: Path, rng: np.random.Generator) -> None:
    """One file changed as its kind suggests; now and then empty, missing, a folder or a link to itself."""
    if rng.random() < 0.05:
        path.unlink()
        replace: tuple[Callable[[], object], ...] = (
            path.touch,
            path.mkdir,
            lambda: path.symlink_to(path),
            lambda: path.symlink_to("/dev/null"),
            lambda: path.symlink_to(path.parent),
            lambda: path.symlink_to("\udcff" * 100),
            lambda: None,
        )
        one_of(replace, rng)()
        return
    content = path.read_bytes()
    how = {".json": mutate_json_text, ".csv": mutate_cells, ".jsonl": mutate_text, ".toml": mutate_toml}.get(
        path.suffix
    )
    if how is None or rng.random() < 0.2:
        path.write_bytes(mutate_bytes(content, rng))
    else:
        path.write_text(how(content.decode(errors="replace"), rng), errors="surrogatepass")


def mutate_folder(folder: Path, rng: np.random.Generator) -> None:
    """One or two files below a folder, changed; those that describe others more often."""
    for _ in range(int(rng.integers(1, 3))):
        files = [path for path in sorted(folder.rglob("*")) if path.is_file() and not path.is_symlink()]
        described = [path for path in files if path.suffix in (".json", ".csv", ".jsonl", ".toml")]
        mutate_file(one_of(described if described and rng.random() < 0.6 else files, rng), rng)
