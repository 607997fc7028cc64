"""Trials that are made up."""

from __future__ import annotations

from typing import Any

from handsight.evaluation.trial import Trial


def make_trial(number: int = 0, method: str = "cem-1", *, success: bool = True, **changes: Any) -> Trial:
    """A trial in which all went well at the table, but what is said."""
    values: dict[str, Any] = {
        "number": number,
        "method": method,
        "success": success,
        "failure": "",
        "moves": 0,
        "compute_s": 0.01,
        "truth_held": success,
    }
    return Trial(**{**values, **changes})
