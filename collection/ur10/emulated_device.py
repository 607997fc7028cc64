"""The client of the emulated camera: a plain socket, for whatever feeds its frames to a RealSense software device.

The protocol is written down in ``emulator/camera.py``.
"""

from __future__ import annotations

import json
import socket
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

LONGEST_HEADER = 1 << 16


@dataclass(frozen=True, slots=True, kw_only=True)
class EmulatedFrame:
    """One RGB-D picture as the emulated camera sends it."""

    number: int
    timestamp_ms: float
    rgb: NDArray[np.uint8]
    """Shape (H, W, 3)."""
    depth: NDArray[np.uint16]
    """In units of the camera's ``depth_scale_m``; 0 is invalid. Shape (H, W)."""


class EmulatedCamera:
    """One connection to the emulated camera."""

    def __init__(self, address: str, port: int, *, timeout_s: float = 2.0) -> None:
        """Connect and learn what it is.

        Raises:
            OSError: It cannot be reached, or does not answer in time (``TimeoutError``).
        """
        self._socket = socket.create_connection((address, port), timeout=timeout_s)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        try:
            self.description: Mapping[str, Any] = self._header()
        except BaseException:
            self._socket.close()
            raise

    def frame(self, timeout_s: float) -> EmulatedFrame:
        """The next picture.

        Raises:
            TimeoutError: None came in time; the connection is of no use any more.
            ConnectionError: The camera is gone.
        """
        self._socket.settimeout(timeout_s)
        self._socket.sendall(b'{"do": "frame"}\n')
        header = self._header()
        height, width = self.description["height"], self.description["width"]
        colour, depth = self._bytes(header["color_bytes"]), self._bytes(header["depth_bytes"])
        return EmulatedFrame(
            number=header["number"],
            timestamp_ms=header["timestamp_ms"],
            rgb=np.frombuffer(colour, np.uint8).reshape(height, width, 3),
            depth=np.frombuffer(depth, "<u2").reshape(height, width).astype(np.uint16),
        )

    def hardware_reset(self) -> None:
        """Have the camera restart; it is gone for some seconds, and this connection with it.

        Raises:
            OSError: It does not answer.
        """
        self._socket.sendall(b'{"do": "hardware_reset"}\n')
        self._header()
        self.close()

    def close(self) -> None:
        """End the connection."""
        self._socket.close()

    def _header(self) -> dict[str, Any]:
        (length,) = struct.unpack(">I", self._bytes(4))
        if length > LONGEST_HEADER:
            raise ConnectionError(f"the emulated camera announces a header of {length} bytes: another protocol?")
        header: dict[str, Any] = json.loads(self._bytes(length))
        return header

    def _bytes(self, count: int) -> bytes:
        data = bytearray(count)
        view = memoryview(data)
        while view:
            got = self._socket.recv_into(view)
            if not got:
                raise ConnectionError("the emulated camera closed the connection")
            view = view[got:]
        return bytes(data)

    def __enter__(self) -> EmulatedCamera:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
