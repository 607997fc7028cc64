"""PyBullet, imported in one place and without its log output.

Its C code prints a build line to standard error when it is imported and a line to standard output for every client,
which would corrupt ``--json`` output. Errors still get through: the streams are back as soon as the call is done.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import sys
from collections.abc import Iterator
from functools import partial
from typing import Any

_flush_c_streams = ctypes.CDLL(None).fflush


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Send what C code prints to nowhere until the block ends."""
    sys.stdout.flush()
    sys.stderr.flush()
    _flush_c_streams(None)
    saved = [(descriptor, os.dup(descriptor)) for descriptor in (1, 2)]
    sink = os.open(os.devnull, os.O_WRONLY)
    try:
        for descriptor, _ in saved:
            os.dup2(sink, descriptor)
        yield
    finally:
        # C buffers its output: without a flush it would come out after the streams are back.
        _flush_c_streams(None)
        for descriptor, copy in saved:
            os.dup2(copy, descriptor)
            os.close(copy)
        os.close(sink)


with quiet():
    import pybullet
    from pybullet_utils import bullet_client

__all__ = ["BulletClient", "connect", "pybullet", "quiet"]


class BulletClient(bullet_client.BulletClient):  # type: ignore[misc]  # Its library has no types.
    """PyBullet's client, which binds a function to its world once, not with every call: a twentieth of an attempt."""

    def __getattr__(self, name: str) -> Any:
        """A function of PyBullet for this client's world, or a constant."""
        attribute = super().__getattr__(name)
        if name == "disconnect":
            # PyBullet gives the number of a world that is gone to the next one.
            for bound in [known for known, value in vars(self).items() if isinstance(value, partial)]:
                delattr(self, bound)
        else:
            setattr(self, name, attribute)
        return attribute


def connect() -> BulletClient:
    """A headless client, with a physics world of its own."""
    with quiet():
        return BulletClient(pybullet.DIRECT)
