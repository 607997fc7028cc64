"""One stored file of a dataset that is damaged or missing, and what to do."""

from __future__ import annotations

from dataclasses import dataclass

_FROM_A_COPY = "put it back from a copy of the dataset"


@dataclass(frozen=True, slots=True, kw_only=True)
class FileDamage:
    """One stored file that is damaged or missing."""

    file: str
    """Its path in the dataset."""
    fault: str
    needed_by: tuple[str, ...] = ()
    """Branches and releases that have it in their history; empty where no version needs it, or none was asked."""
    remedy: str = _FROM_A_COPY

    def __str__(self) -> str:
        needed = f" (needed by {', '.join(self.needed_by)})" if self.needed_by else ""
        return f"{self.file}{needed} {self.fault}: {self.remedy}"
