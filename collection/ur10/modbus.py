"""As much Modbus TCP as a gripper needs: read and write holding registers."""

from __future__ import annotations

import contextlib
import socket
import struct
from collections.abc import Sequence

from handsight.collection.errors import DeviceError, DeviceLostError

READ_HOLDING, WRITE_SEVERAL = 3, 16
EXCEPTION_BIT = 0x80
_HEADER = struct.Struct(">HHHB")  # transaction, protocol 0, bytes that follow with the unit, unit


class Modbus:
    """One connection to one unit."""

    def __init__(self, address: str, port: int, unit: int, *, timeout_s: float) -> None:
        """Connect.

        Raises:
            DeviceLostError: Nobody answers.
        """
        self._where = f"Modbus {address}:{port}"
        self._unit = unit
        self._number = 0
        try:
            self._socket = socket.create_connection((address, port), timeout=timeout_s)
        except OSError as error:
            raise DeviceLostError(f"{self._where}: {error}") from error

    def read(self, first: int, count: int = 1) -> list[int]:
        """So many 16-bit registers from ``first`` on.

        Raises:
            DeviceError: The unit refuses.
            DeviceLostError: It does not answer.
        """
        answer = self._ask(struct.pack(">BHH", READ_HOLDING, first, count))
        if len(answer) != 2 + 2 * count or answer[1] != 2 * count:
            raise DeviceError(f"{self._where}: {len(answer)} bytes for {count} registers")
        return list(struct.unpack(f">{count}H", answer[2:]))

    def write(self, first: int, values: Sequence[int]) -> None:
        """Write registers from ``first`` on.

        Raises:
            DeviceError: The unit refuses.
            DeviceLostError: It does not answer.
        """
        count = len(values)
        head = struct.pack(">BHHB", WRITE_SEVERAL, first, count, 2 * count)
        self._ask(head + struct.pack(f">{count}H", *values))

    def close(self) -> None:
        """End the connection."""
        with contextlib.suppress(OSError):
            self._socket.close()

    def _ask(self, request: bytes) -> bytes:
        self._number = (self._number + 1) % 65536
        try:
            self._socket.sendall(_HEADER.pack(self._number, 0, 1 + len(request), self._unit) + request)
            number, protocol, length, _ = _HEADER.unpack(self._bytes(_HEADER.size))
            answer = self._bytes(length - 1)
        except OSError as error:
            raise DeviceLostError(f"{self._where}: {str(error) or type(error).__name__}") from error
        if (number, protocol) != (self._number, 0) or len(answer) < 2:
            raise DeviceLostError(f"{self._where}: an answer to another request")
        if answer[0] == request[0] | EXCEPTION_BIT:
            raise DeviceError(f"{self._where}: refused with exception {answer[1]}")
        if answer[0] != request[0]:
            raise DeviceError(f"{self._where}: function {answer[0]} answered, expected {request[0]}")
        return answer

    def _bytes(self, count: int) -> bytes:
        data = b""
        while len(data) < count:
            got = self._socket.recv(count - len(data))
            if not got:
                raise ConnectionError("the connection was closed")
            data += got
        return data
