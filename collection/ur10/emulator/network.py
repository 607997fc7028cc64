"""Listening on a device's own loopback address, and the ways in which a network fails."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Awaitable, Callable

Handler = Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]]
GONE = (ConnectionError, asyncio.IncompleteReadError, TimeoutError, OSError)
MOST_UNSENT = 1 << 20
"""Bytes that a client may leave unread before what is new is dropped."""


class Network:
    """All servers of one device."""

    def __init__(self, address: str) -> None:
        """Nothing listens yet."""
        self.address = address
        self._services: list[tuple[int, Handler]] = []
        self._servers: list[asyncio.Server] = []
        self._writers: set[asyncio.StreamWriter] = set()
        self._tasks: set[asyncio.Task[None]] = set()
        self._flowing = asyncio.Event()
        self._flowing.set()

    def serve(self, port: int, handler: Handler) -> None:
        """Have ``handler`` answer on a port, from :meth:`open` on."""
        self._services.append((port, handler))

    async def open(self) -> None:
        """Listen on all ports.

        Raises:
            OSError: Some port is taken, or the address is none of this machine.
        """
        for port, handler in self._services:
            self._servers.append(await asyncio.start_server(self._guarded(handler), self.address, port))

    @property
    def frozen(self) -> bool:
        """Whether nothing gets through."""
        return not self._flowing.is_set()

    async def thawed(self) -> None:
        """Wait until something gets through."""
        await self._flowing.wait()

    def freeze(self, seconds: float) -> None:
        """Let nothing through for a while, with all connections up."""
        self._flowing.clear()
        asyncio.get_running_loop().call_later(seconds, self._flowing.set)

    def drop(self) -> None:
        """Cut all connections; new ones are welcome."""
        for writer in list(self._writers):
            writer.transport.abort()

    async def vanish(self, seconds: float) -> None:
        """Cut all connections and refuse new ones for a while."""
        self.close()
        await asyncio.sleep(seconds)
        await self.open()

    def close(self) -> None:
        """Stop listening and cut all connections."""
        for server in self._servers:
            server.close()
        self._servers.clear()
        self.drop()

    def send(self, writer: asyncio.StreamWriter, data: bytes) -> None:
        """Send, unless nothing gets through or the client does not read."""
        transport = writer.transport
        if self._flowing.is_set() and not transport.is_closing() and transport.get_write_buffer_size() < MOST_UNSENT:
            writer.write(data)

    def _guarded(self, handler: Handler) -> Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]]:
        async def run(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            self._writers.add(writer)
            try:
                await self._flowing.wait()
                await handler(reader, writer)
            except GONE:
                pass  # The client is gone, which is its right.
            finally:
                self._writers.discard(writer)
                with contextlib.suppress(*GONE):
                    writer.close()

        return run
