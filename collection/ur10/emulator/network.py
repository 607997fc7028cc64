"""Listening on a device's own loopback address, and the ways in which a network fails.

Connections are accepted here and not by ``asyncio.start_server``: its server, closed in the moment in which it accepts,
forgets the connection without closing it, and a client waits for its time to run out.
"""

from __future__ import annotations

import asyncio
import contextlib
import socket
from collections.abc import Awaitable, Callable, Coroutine
from typing import Any

Handler = Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]]
GONE = (ConnectionError, asyncio.IncompleteReadError, TimeoutError, OSError)
BACKLOG = 16
MOST_UNSENT = 1 << 20
"""Bytes that a client may leave unread before what is new is dropped."""


class Network:
    """All servers of one device."""

    def __init__(self, address: str) -> None:
        """Nothing listens yet."""
        self.address = address
        self._services: list[tuple[int, Handler]] = []
        self._listening: list[socket.socket] = []
        self._accepting: list[asyncio.Task[None]] = []
        self._connections: set[socket.socket] = set()
        self._writers: set[asyncio.StreamWriter] = set()
        self._tasks: set[asyncio.Task[None]] = set()
        self._flowing = asyncio.Event()
        self._flowing.set()

    def serve(self, port: int, handler: Handler) -> None:
        """Have ``handler`` answer on a port, from :meth:`open` on."""
        self._services.append((port, handler))

    async def open(self) -> None:
        """Listen on all ports, unless it does.

        Raises:
            OSError: Some port is taken, or the address is none of this machine.
        """
        if self._listening:
            return
        for port, handler in self._services:
            listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
            self._listening.append(listening)
            listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listening.setblocking(False)
            try:
                listening.bind((self.address, port))
                listening.listen(BACKLOG)
            except OSError as error:
                self.shut()
                raise OSError(error.errno, f"{error.strerror} at {self.address}:{port}") from error
            self._accepting.append(asyncio.create_task(self._accept(listening, handler)))

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
        for connection in list(self._connections):
            connection.close()

    async def vanish(self, seconds: float) -> None:
        """Cut all connections and refuse new ones for a while."""
        self.close()
        await asyncio.sleep(seconds)
        await self.open()

    def shut(self) -> None:
        """Refuse new connections; those that are up stay."""
        for task in self._accepting:
            task.cancel()
        for listening in self._listening:
            listening.close()
        self._accepting.clear()
        self._listening.clear()

    def close(self) -> None:
        """Refuse new connections and cut those that are up."""
        self.shut()
        self.drop()

    def send(self, writer: asyncio.StreamWriter, data: bytes) -> None:
        """Send, unless nothing gets through or the client does not read."""
        transport = writer.transport
        if self._flowing.is_set() and not transport.is_closing() and transport.get_write_buffer_size() < MOST_UNSENT:
            writer.write(data)

    def keep(self, work: Coroutine[Any, Any, None]) -> None:
        """Run something beside everything else, to its end."""
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _accept(self, listening: socket.socket, handler: Handler) -> None:
        loop = asyncio.get_running_loop()
        while True:
            connection, _ = await loop.sock_accept(listening)
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._connections.add(connection)
            self.keep(self._converse(connection, handler))

    async def _converse(self, connection: socket.socket, handler: Handler) -> None:
        writer = None
        try:
            reader, writer = await asyncio.open_connection(sock=connection)
            self._connections.discard(connection)
            self._writers.add(writer)
            await self._flowing.wait()
            await handler(reader, writer)
        except GONE:
            pass  # The client is gone, which is its right.
        finally:
            self._connections.discard(connection)
            if writer is None:
                connection.close()
            else:
                self._writers.discard(writer)
                with contextlib.suppress(*GONE):
                    writer.close()
