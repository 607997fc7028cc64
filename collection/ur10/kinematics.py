"""The identity of an arm: the checksums of its own kinematic calibration, from the controller's primary port.

Every arm was measured in the factory, and its controller computes with what was measured. The primary interface (port
30001) tells checksums of it in the sub-package "kinematics info" of a robot state message, once after connecting.
"""

from __future__ import annotations

import socket
import struct
import time

from handsight.collection.errors import DeviceLostError

ROBOT_STATE, KINEMATICS_INFO = 16, 5
MOST_BYTES = 1 << 20
CHECKSUMS = 6


def kinematics_id(address: str, port: int = 30001, *, timeout_s: float = 3.0) -> str | None:
    """Six checksums as hexadecimal digits; None where the controller tells none within the time.

    Raises:
        DeviceLostError: Nobody answers on the port.
    """
    until = time.monotonic() + timeout_s
    try:
        with socket.create_connection((address, port), timeout=timeout_s) as connection:
            while time.monotonic() < until:
                found = checksums_in(_message(connection))
                if found:
                    return found
    except TimeoutError:
        return None
    except OSError as error:
        raise DeviceLostError(f"primary port {address}:{port}: {error}") from error
    return None


def checksums_in(message: bytes) -> str | None:
    """The checksums in one message of the primary interface, its length left out; None where it has none."""
    if not message or message[0] != ROBOT_STATE:
        return None
    at = 1
    while at + 5 <= len(message):
        size, kind = struct.unpack_from(">IB", message, at)
        if size < 5:
            return None
        if kind == KINEMATICS_INFO and size >= 5 + 4 * CHECKSUMS and at + size <= len(message):
            return "".join(f"{value:08x}" for value in struct.unpack_from(f">{CHECKSUMS}I", message, at + 5))
        at += size
    return None


def _message(connection: socket.socket) -> bytes:
    (length,) = struct.unpack(">I", _bytes(connection, 4))
    if not 5 <= length <= MOST_BYTES:
        raise ConnectionError(f"a message of {length} bytes: another protocol")
    return _bytes(connection, length - 4)


def _bytes(connection: socket.socket, count: int) -> bytes:
    data = b""
    while len(data) < count:
        got = connection.recv(count - len(data))
        if not got:
            raise ConnectionError("the connection was closed")
        data += got
    return data
