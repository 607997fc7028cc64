"""Coverage of what tests start as processes of their own, where those end in peace."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import coverage
import pytest

ROOT = Path(__file__).resolve().parents[2]


@contextmanager
def measured_children() -> Iterator[None]:
    """Measure processes that start in this block where this one is measured; those that are killed tell nothing.

    A device's child leaves by ``os._exit``, behind which nothing else would be written.
    """
    here = coverage.Coverage.current()
    if here is None:
        yield
        return
    config = copy.copy(here.config)
    config.parallel = True
    config.patch = ["_exit"]
    config.data_file = str(ROOT / ".coverage")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("COVERAGE_PROCESS_CONFIG", config.serialize())
        yield
