"""What might be typed where a command takes a value: mostly nearly right, now and then nothing of the kind.

Every function draws one text from a NumPy generator, so a seed names the texts it draws.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

_SCRAPS = (
    "",
    " ",
    "\n",
    "\t",
    "\0",
    "'",
    '"',
    "\\",
    "é",
    "\u202e",
    "\ud800",
    "½",
    "\uff19",
    "%",
    "$HOME",
    "~",
    "-",
    "--",
    "..",
)
_COLUMNS = (
    "success",
    "target",
    "number",
    "width_final_m",
    "started",
    "objects",
    "excluded",
    "seed",
    "attempt",
    "widht",
)
_CONSTANTS = (
    "0",
    "1",
    "0.01",
    "-3",
    "1e999",
    "9" * 40,
    "'cup'",
    "'True'",
    "''",
    "'2026-01-31'",
    "None",
    "True",
    "b'x'",
    "1j",
)
_OPERATORS = (
    ">",
    "<",
    "==",
    "!=",
    "<=",
    "in",
    "not in",
    "and",
    "or",
    "&",
    "|",
    "+",
    "*",
    "%",
    "**",
    "//",
    "is",
    "@",
    "=",
    "^",
)
_PATTERNS = (
    "cup",
    "(",
    "(a)\\\\1",
    "(a+)+$",
    "(?=a)",
    "a{1000}{1000}",
    ".*" * 40 + "b",
    "[",
    "\\\\s",
    "(?i)CUP",
    "\\\\N{DASH}",
)
_METHODS = (
    ".isna()",
    ".notna()",
    ".str.lower()",
    ".str.upper()",
    ".between(0, 1)",
    ".isin([1, 'a'])",
    ".__class__",
    ".str",
)


def where_text(rng: np.random.Generator) -> str:
    """An expression for ``--where``, sound or not."""
    text = _term(rng, depth=int(rng.integers(0, 4)))
    match int(rng.integers(0, 12)):
        case 0:
            levels = int(rng.integers(1, 2000))
            text = "(" * levels + text + ")" * levels
        case 1:
            text = f"{_pick(rng, ('not ', '~', '-', 'abs('))}" * int(rng.integers(1, 1500)) + text
        case 2:
            text = _pick(rng, (" | ", " or ", " + ", ", ")).join([text] * int(rng.integers(2, 900)))
        case 3:
            text = f"target.str.contains('{_pick(rng, _PATTERNS)}')"
        case 4:
            text = damaged(rng, text)
    return text


def address_text(rng: np.random.Generator, dataset: str = "grasps") -> str:
    """A dataset with or without a ref, or what is none."""
    refs = ("main", "v1", "handsight.releases", "7GY67115Y39FFMP913PG", "refs/heads/main", "main~1", "@", "v1@main")
    schemes = (
        "",
        "s3://",
        "s3:/",
        "s3:",
        "S3://",
        "gs://",
        "https://",
        "file://",
        "s3://b/",
        "s3://Bucket_/",
        "s3://a..b/",
    )
    text = _pick(rng, schemes) + dataset + "@" * int(rng.integers(0, 3)) + _pick(rng, refs)
    return damaged(rng, text) if rng.random() < 0.4 else text


def attempt_text(rng: np.random.Generator, attempt: str = "01M8A8K01KDE9KJZ4VD127MAWY-000003") -> str:
    """An attempt's id, a beginning of one, a number, or what is none of them."""
    numbers = ("0", "3", "-1", "1e3", "0x3", "9" * 5000, "3.0", "+3", " 3", "\uff10", "999999999999")
    match int(rng.integers(0, 4)):
        case 0:
            return _pick(rng, numbers)
        case 1:
            return attempt[: int(rng.integers(0, len(attempt) + 1))]
        case 2:
            return f"{attempt[:26]}-{_pick(rng, numbers)}"
    return damaged(rng, attempt)


def age_text(rng: np.random.Generator) -> str:
    """An age or a date, as ``gc --older-than`` takes them, or what is none."""
    numbers = ("0", "1", "7", "-1", "9" * 14, "9" * 4400, "1.5", "1e9", "nan", "", "\uff12")
    dates = (
        "2026-01-31",
        "0001-01-01",
        "9999-12-31T23:59:59",
        "2026-02-30",
        "2026-01-31T00:00+14:00",
        "20260131",
        "now",
    )
    text = (
        _pick(rng, numbers) + _pick(rng, ("s", "m", "h", "d", "w", "y", ""))
        if rng.random() < 0.6
        else _pick(rng, dates)
    )
    return damaged(rng, text) if rng.random() < 0.3 else text


TYPED: dict[str, Callable[[np.random.Generator], str]] = {
    "where": where_text,
    "address": address_text,
    "attempt": attempt_text,
    "age": age_text,
}
"""The drawers by what they draw."""


def damaged(rng: np.random.Generator, text: str) -> str:
    """The text with something cut out, put in, doubled, or overlong."""
    at, to = sorted(int(place) for place in rng.integers(0, len(text) + 1, 2))
    match int(rng.integers(0, 4)):
        case 0:
            return text[:at] + text[to:]
        case 1:
            return text[:at] + _pick(rng, _SCRAPS) + text[at:]
        case 2:
            return text[:to] + text[at:]
    return text[:at] + text[at:to] * int(rng.integers(1, 300)) + text[to:]


def _term(rng: np.random.Generator, depth: int) -> str:
    if not depth:
        leaf = _pick(rng, _COLUMNS if rng.random() < 0.6 else _CONSTANTS)
        return leaf + (_pick(rng, _METHODS) if rng.random() < 0.2 else "")
    left, right = (_term(rng, depth - 1) for _ in range(2))
    if rng.random() < 0.1:
        right = f"[{right}, {_pick(rng, _CONSTANTS)}]"
    return (
        f"({left} {_pick(rng, _OPERATORS)} {right})"
        if rng.random() < 0.6
        else f"{left} {_pick(rng, _OPERATORS)} {right}"
    )


def _pick(rng: np.random.Generator, choices: Sequence[str]) -> str:
    return choices[int(rng.integers(len(choices)))]
