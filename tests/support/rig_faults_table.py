"""The fault matrix as a table of Markdown: a row for each fault, a column for each phase."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any

from handsight.collection.ur10.rig import GENERATIONS

LETTERS = {"unharmed": "u", "recovered": "r", "paused": "p", "stopped": "s", "did not happen": "x"}
NOT_RUN = "–"


def table(lines: Iterable[dict[str, Any]], faults: Sequence[str], phases: Sequence[str]) -> str:
    """The table, and below it what there is of each end; a cell has CB3 and e-Series, one letter where both are alike.

    Args:
        lines: Cases as :mod:`tests.support.rig_faults` keeps them.
        faults: Rows; those of which there is no case are left out.
        phases: Columns.
    """
    ends: dict[tuple[str, str, str], str] = {}
    wrong = 0
    for line in lines:
        ends[line["fault"], line["phase"], line["generation"]] = LETTERS[line["ending"]]
        wrong += bool(line["wrong"])
    rows = [f"| fault | {' | '.join(phases)} | ends |", f"|---|{'---|' * len(phases)}---|"]
    for fault in faults:
        found = {key: end for key, end in ends.items() if key[0] == fault}
        if found:
            cells = [_cell([found.get((fault, phase, name), NOT_RUN) for name in GENERATIONS]) for phase in phases]
            rows.append(f"| `{fault}` | {' | '.join(cells)} | {_counts(found.values())} |")
    of_each = [f"{_counts(end for key, end in ends.items() if key[2] == name)} on {name}" for name in GENERATIONS]
    legend = ", ".join(f"{letter} {name}" for name, letter in LETTERS.items())
    return "\n".join([*rows, "", f"{legend}. {len(ends)} cases: {'; '.join(of_each)}; {wrong} went wrong."])


def _counts(ends: Iterable[str]) -> str:
    return ", ".join(f"{count} {end}" for end, count in Counter(ends).most_common())


def _cell(ends: Sequence[str]) -> str:
    return ends[0] if len(set(ends)) == 1 else "/".join(ends)
