"""Checks of one value that anybody may have written: each says what was expected instead, or nothing.

For files whose values have ranges, and whose messages say where each stands. What becomes a dataclass of ours is read
with ``typed``, which knows the same kinds.
"""

from __future__ import annotations

from collections.abc import Callable

from handsight.datasets.format.typed import is_a

Check = Callable[[object], str | None]
"""What was expected of a value; None where it is as expected."""


def whole(least: int, most: int, expected: str = "") -> Check:
    """A whole number in a range; ``expected`` is what to call it."""
    return _in_range(int, least, most, expected or f"a whole number of {least} to {most}")


def number(least: float, most: float, expected: str = "") -> Check:
    """A number in a range, which NaN is not; ``expected`` is what to call it."""
    return _in_range(float, least, most, expected or f"a number of {least:g} to {most:g}")


def one_of(*values: str) -> Check:
    """One of some words."""
    return lambda value: None if isinstance(value, str) and value in values else f"one of {', '.join(values)}"


def text(longest: int) -> Check:
    """Text of so many characters or fewer."""
    return lambda value: (
        None if isinstance(value, str) and len(value) <= longest else f"text of at most {longest} characters"
    )


def truth(value: object) -> str | None:
    """True or false."""
    return None if isinstance(value, bool) else "true or false"


def or_null(check: Check) -> Check:
    """What another check expects, or null."""

    def nullable(value: object) -> str | None:
        expected = None if value is None else check(value)
        return None if expected is None else f"{expected}, or null"

    return nullable


def is_number(value: object, least: float, most: float) -> bool:
    """Whether a value is a number in a range."""
    return is_a(float, value) and least <= value <= most  # type: ignore[operator]  # It is a number.


def _in_range(kind: type, least: float, most: float, expected: str) -> Check:
    return lambda value: None if is_a(kind, value) and is_number(value, least, most) else expected
