"""JSON values of anybody's as the dataclasses that they claim to be: every field by its type, all faults at once.

What was written elsewhere is read with this before anything is allocated or written. Numbers stay what they were, a
whole number where a length is wanted included, because digests are made of their text. Ranges are checked afterwards
(``validation.py``). Decision 015 says why this is no library.
"""

from __future__ import annotations

import types
from collections.abc import Callable, Sequence
from dataclasses import MISSING, fields, is_dataclass
from functools import cache
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from handsight.datasets.errors import HeaderError, counted

T = TypeVar("T")

_SHOWN = 10
"""Faults that are listed; of more the number is said."""

_LONGEST_TEXT = 60
"""Characters of a value that a message shows."""

_WORDS = {str: "text", int: "a whole number", float: "a number", bool: "true or false", type(None): "null"}


class _Faults:
    """What is wrong, in the order in which it was found."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def add(self, name: str, value: object, expected: str) -> None:
        self.lines.append(f"{name or 'it'} is {shown(value)}, expected {expected}")


def typed(kind: type[T], value: object, name: str = "") -> T:
    """The dataclass ``kind`` from what JSON made of it.

    Args:
        kind: A dataclass of texts, numbers, truth values, tuples, dicts, literals, optional ones of them and other
            dataclasses.
        value: JSON values.
        name: What to call the whole; its fields are called ``NAME.FIELD``.

    Raises:
        HeaderError: A field is missing, unknown or of another type, or a dataclass refuses its values; every fault is
            said.
    """
    faults = _Faults()
    try:
        made = _record(kind, value, name, faults)
    except RecursionError as error:
        raise HeaderError(f"{name or 'it'} is nested too deeply: expected a few levels") from error
    if faults.lines:
        raise HeaderError(listed(faults.lines))
    return made  # type: ignore[no-any-return]  # Of that kind, where there are no faults.


def listed(faults: Sequence[str]) -> str:
    """Faults on one line: the first of them, and how many more there are."""
    more = len(faults) - _SHOWN
    return "; ".join(faults[:_SHOWN]) + (f"; and {counted(more, 'more fault')}" if more > 0 else "")


def shown(value: object) -> str:
    """A value for a message: as JSON has it, and no longer than a message may be."""
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    if isinstance(value, dict | list | tuple):
        return f"an object of {counted(len(value), 'field')}" if isinstance(value, dict) else f"a list of {len(value)}"
    if isinstance(value, int) and value.bit_length() > 128:
        return f"a number of {value.bit_length()} bits"
    text = repr(value)
    return text if len(text) <= _LONGEST_TEXT else f"{text[:_LONGEST_TEXT]}…"


@cache
def _types(kind: type) -> dict[str, Any]:
    return get_type_hints(kind)


def _record(kind: type, value: object, name: str, faults: _Faults) -> Any:
    if not isinstance(value, dict):
        faults.add(name, value, f"an object with {', '.join(one.name for one in fields(kind))}")
        return None
    before = len(faults.lines)
    known = {field.name: field for field in fields(kind)}
    unknown = [key for key in value if key not in known]
    if unknown:
        names = ", ".join(shown(key) for key in unknown[:_SHOWN])
        faults.lines.append(f"{_path(name, 'fields')} {names} are unknown, expected {', '.join(known)}")
    values = {}
    for field_name, field in known.items():
        if field_name in value:
            hint = _types(kind)[field_name]
            values[field_name] = _value(hint, value[field_name], _path(name, field_name), faults)
        elif field.default is MISSING and field.default_factory is MISSING:
            faults.lines.append(f"{_path(name, field_name)} is missing")
    if len(faults.lines) > before:
        return None
    try:
        return kind(**values)
    except (ValueError, OverflowError) as error:
        faults.lines.append(f"{name}: {error}" if name else str(error))
        return None


def _value(hint: Any, value: object, name: str, faults: _Faults) -> Any:
    origin = get_origin(hint)
    if origin is not None:
        return _KINDS[origin](get_args(hint), value, name, faults)
    if hint is Any:
        return value
    if is_dataclass(hint) and isinstance(hint, type):
        return _record(hint, value, name, faults)
    if not is_a(hint, value):
        faults.add(name, value, _WORDS[hint])
    elif hint is float and not _fits_float(value):
        faults.add(name, value, "a number that is not beyond all measure")
    return value


def is_a(hint: type, value: object) -> bool:
    """Whether a JSON value is of a type: a whole number is a number, and a truth value is neither."""
    if hint is float:
        return isinstance(value, float | int) and not isinstance(value, bool)
    if hint is int:
        return isinstance(value, int) and not isinstance(value, bool)
    return isinstance(value, hint)


def _fits_float(value: Any) -> bool:
    try:
        float(value)
    except OverflowError:
        return False
    return True


def _optional(kinds: tuple[Any, ...], value: object, name: str, faults: _Faults) -> Any:
    """``X | None``; no dataclass here has unions of another kind."""
    return None if value is None else _value(kinds[0], value, name, faults)


def _tuple(kinds: tuple[Any, ...], value: object, name: str, faults: _Faults) -> Any:
    if not isinstance(value, list | tuple):
        faults.add(name, value, "a list")
        return ()
    return tuple(_value(kinds[0], one, f"{name}[{at}]", faults) for at, one in enumerate(value))


def _dict(kinds: tuple[Any, ...], value: object, name: str, faults: _Faults) -> Any:
    if not isinstance(value, dict):
        faults.add(name, value, "an object")
        return {}
    return {
        _value(kinds[0], key, f"a key of {name}", faults): _value(kinds[1], one, f"{name}.{shown(key)}", faults)
        for key, one in value.items()
    }


def _literal(kinds: tuple[Any, ...], value: object, name: str, faults: _Faults) -> Any:
    if not isinstance(value, str) or value not in kinds:
        faults.add(name, value, " or ".join(kinds))
    return value


def _path(name: str, field: str) -> str:
    return f"{name}.{field}" if name else field


_KINDS: dict[Any, Callable[[tuple[Any, ...], object, str, _Faults], Any]] = {
    types.UnionType: _optional,
    Union: _optional,
    tuple: _tuple,
    dict: _dict,
    Literal: _literal,
}
"""What reads a value of a generic type, by its origin."""
