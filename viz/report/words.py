"""How numbers are written in a report."""

from __future__ import annotations

from collections.abc import Sequence


def percent(rate: float) -> str:
    """A share in per cent."""
    return f"{100 * rate:.1f} %"


def interval(ends: Sequence[float]) -> str:
    """The ends of an interval of shares, in per cent."""
    return f"{100 * ends[0]:.1f} to {100 * ends[1]:.1f} %"


def count(number: int) -> str:
    """A count with its thousands apart."""
    return f"{number:,}"


def figure(value: float | None, digits: int = 3) -> str:
    """A number, or a dash where there is none."""
    return "–" if value is None else f"{value:.{digits}f}"


def said(value: object) -> str:
    """Any value of a record, in words."""
    if value is None or value == "":
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, list | tuple):
        return ", ".join(map(said, value)) or "–"
    if isinstance(value, dict):
        return ", ".join(f"{name} {said(part)}" for name, part in value.items()) or "–"
    return f"{value:g}" if isinstance(value, float) else str(value)


def written(iso: str | None) -> str:
    """A recorded time to the second, UTC; a dash where there is none."""
    return "–" if not iso else iso.replace("T", " ").removesuffix("+00:00")[:19] + " UTC"
