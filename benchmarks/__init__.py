"""Figures of handsight, each beside the floor it cannot beat and the peers it should: ``python -m benchmarks NAME``.

Every file in this folder is a benchmark of that name, except those that begin with an underscore. It has a function
``run() -> list[Figure]`` whose first figure is the headline, and a docstring whose first line is shown by ``--help``.
``floors`` and ``peers`` hold what is measured against.
Nothing here asserts: a figure is a measurement on one machine, and only its ratios travel to another.
"""

from __future__ import annotations

from benchmarks._figures import Figure, duration_s, median_rate, median_s

__all__ = ["Figure", "duration_s", "median_rate", "median_s"]
