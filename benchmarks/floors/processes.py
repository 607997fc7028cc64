"""Processes on chosen cores, and the memory they take, as Linux counts it."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Collection, Iterator
from pathlib import Path


@contextlib.contextmanager
def pinned(cores: Collection[int]) -> Iterator[None]:
    """Keep this process, and every process it starts, on some cores until the block ends."""
    before = os.sched_getaffinity(0)
    _pin_threads(cores)
    try:
        yield
    finally:
        _pin_threads(before)


def _pin_threads(cores: Collection[int]) -> None:
    # The affinity is a thread's own: without this, those of the storage engine that already run would go on elsewhere.
    for thread in Path("/proc/self/task").iterdir():
        with contextlib.suppress(ProcessLookupError):  # It ended meanwhile.
            os.sched_setaffinity(int(thread.name), cores)


def proportional_bytes(pid: int) -> int:
    """Memory of a process in which a page that n processes share counts for one n-th (PSS) [bytes]."""
    lines = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
    (kibibytes,) = (line.split()[1] for line in lines if line.startswith("Pss:"))
    return 1024 * int(kibibytes)
