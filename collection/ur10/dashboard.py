"""The dashboard server of the controller: states, and the few commands that recovery needs."""

from __future__ import annotations

import socket
from types import TracebackType

from handsight.collection.errors import DeviceLostError

TIMEOUT_S = 3.0


class Dashboard:
    """One connection, opened for a few commands and closed."""

    def __init__(self, address: str, port: int = 29999, *, timeout_s: float = TIMEOUT_S) -> None:
        """Connect and read the greeting.

        Raises:
            DeviceLostError: Nobody answers.
        """
        self._where = f"dashboard {address}:{port}"
        try:
            self._socket = socket.create_connection((address, port), timeout=timeout_s)
            self._file = self._socket.makefile("rb")
            self._line()
        except OSError as error:
            raise DeviceLostError(f"{self._where}: {error}") from error

    def ask(self, command: str) -> str:
        """Send a command and return the line that answers it.

        Raises:
            DeviceLostError: None came.
        """
        try:
            self._socket.sendall(f"{command}\n".encode())
            return self._line()
        except OSError as error:
            raise DeviceLostError(f"{self._where}: {command}: {error}") from error

    def safety(self) -> str:
        """``NORMAL``, ``REDUCED``, ``PROTECTIVE_STOP``, ``SAFEGUARD_STOP``, ``ROBOT_EMERGENCY_STOP`` and so on.

        Old controllers know the question by another name.
        """
        for command in ("safetystatus", "safetymode"):
            head, _, value = self.ask(command).partition(":")
            if head.strip().lower() in ("safetystatus", "safetymode"):
                return value.strip()
        return "UNKNOWN"

    def mode(self) -> str:
        """``RUNNING``, ``IDLE``, ``POWER_OFF`` and so on."""
        return self.ask("robotmode").partition(":")[2].strip()

    def remote(self) -> bool | None:
        """Whether the controller is in remote control; None where it does not know the difference, as CB3."""
        answer = self.ask("is in remote control").strip().lower()
        return {"true": True, "false": False}.get(answer)

    def _line(self) -> str:
        line = self._file.readline(4096)
        if not line.endswith(b"\n"):
            raise ConnectionError("the connection was closed")
        return line.decode("utf-8", errors="replace").strip()

    def close(self) -> None:
        """End the connection."""
        self._file.close()
        self._socket.close()

    def __enter__(self) -> Dashboard:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
