"""Prints how much of every room the tests ran, from coverage's JSON report.

A room is a top-level folder; `datasets` is shown by its own rooms too. Exits with 1 where a room is below the floor.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from pathlib import Path

FLOOR_PERCENT = 90
FLOORS_PERCENT = {"jobs": 85}
"""What of this room runs in workers and in the threads of Ray is not measured."""
WITH_ROOMS_OF_THEIR_OWN = ("datasets",)


def rooms_of(file: str) -> list[str]:
    """Every room that a file lies in: ``datasets/store/refs.py`` lies in ``datasets`` and in ``datasets/store``."""
    room, *folders = file.split("/")[:-1]
    return [room, f"{room}/{folders[0]}"] if folders and room in WITH_ROOMS_OF_THEIR_OWN else [room]


def main(report: Path) -> int:
    """Print one line a room and return the exit status."""
    statements: Counter[str] = Counter()
    missed: Counter[str] = Counter()
    for file, found in json.loads(report.read_text())["files"].items():
        for room in (*rooms_of(file), "all rooms"):
            statements[room] += found["summary"]["num_statements"]
            missed[room] += found["summary"]["missing_lines"]
    low = []
    print(f"{'room':24}{'statements':>12}{'not run':>10}{'covered':>10}")
    for room in (*sorted(statements.keys() - {"all rooms"}), "all rooms"):
        percent = 100 * (1 - missed[room] / max(1, statements[room]))
        print(f"{room:24}{statements[room]:12}{missed[room]:10}{percent:9.1f}%")
        floor = FLOORS_PERCENT.get(room, FLOOR_PERCENT)
        low += [f"{room} below {floor} %"] if percent < floor else []
    if low:
        print("; ".join(low))
    return 1 if low else 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
