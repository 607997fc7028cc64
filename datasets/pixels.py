"""Decoded pictures on their way into the array that is read: colours that lie apart put side by side."""

from __future__ import annotations

from typing import Any

import numpy as np
from zarr.abc.buffer import BufferPrototype
from zarr.buffer import cpu

_FEW = 4
"""Most values of a pixel that are copied one colour after the other."""


class PixelBuffer(cpu.NDBuffer):
    """NumPy memory as zarr uses it, which copies a transposed picture colour by colour.

    NumPy copies along the last axis of its target, and of a pixel that is three bytes at a time: 0.9 ms for a picture
    of 640x480, and 0.25 ms by colour. Pictures are stored with their colours apart (schema.py).
    """

    def __setitem__(self, key: Any, value: Any) -> None:
        source = value.as_numpy_array() if isinstance(value, cpu.NDBuffer) else np.asarray(value)
        # Only slices select a view; a copy would be filled and forgotten.
        sliced = isinstance(key, tuple) and all(isinstance(one, slice) for one in key)
        if sliced and source.ndim > 1 and source.shape[-1] <= _FEW and not source.flags.c_contiguous:
            target = self.as_numpy_array()[key]
            for colour in range(source.shape[-1]):
                target[..., colour] = source[..., colour]
        else:
            self.as_numpy_array()[key] = source


PIXELS = BufferPrototype(buffer=cpu.Buffer, nd_buffer=PixelBuffer)
"""What zarr is to read pictures with."""
