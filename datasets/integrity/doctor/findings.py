"""What a check reports."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from handsight.datasets.errors import counted

Severity = Literal["error", "warning", "note"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One thing that is not as it should be."""

    code: str
    """Stable, such as GD-101; listed in the docstring of this package."""
    severity: Severity
    attempts: tuple[str, ...]
    """Ids of the attempts it concerns; empty where it concerns the dataset as a whole."""
    message: str


def attempt_finding(code: str, severity: Severity, attempts: Iterable[str], message: str) -> list[Finding]:
    """One finding about some attempts; none where there are no attempts.

    In the message ``{n}`` is their number, and ``{attempts}`` the number with its noun.
    """
    ids = tuple(attempts)
    text = message.format(n=len(ids), attempts=counted(len(ids), "attempt"))
    return [Finding(code=code, severity=severity, attempts=ids, message=text)] if ids else []


def dataset_finding(code: str, severity: Severity, message: str) -> Finding:
    """A finding about the dataset as a whole."""
    return Finding(code=code, severity=severity, attempts=(), message=message)
