"""Memory of a process that trains or scores: kept between two steps, not given back to the system.

A step asks for some dozens of blocks of a few megabytes and lets go of all of them. Left to itself, the allocator of
glibc gives them back each time, and the kernel clears every page anew: a third of a step's time.
"""

from __future__ import annotations

import ctypes
from functools import cache

_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3
"""Names of parameters of ``mallopt`` in glibc."""
_KEPT_BYTES = 1 << 30
_MOST_BYTES = 1 << 25
"""What older versions of glibc take at most."""


@cache
def keep_freed_memory() -> bool:
    """Let this process keep what it frees, up to a gigabyte, for what it asks for next; once is enough.

    Returns:
        Whether its allocator can be told so; other systems than Linux with glibc have none that can.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is None:
        return False
    kept = [mallopt(name, _KEPT_BYTES) or mallopt(name, _MOST_BYTES) for name in (_TRIM_THRESHOLD, _MMAP_THRESHOLD)]
    return all(kept)
