"""A door before the catalog: what is asked for is made before the question is passed on.

Rerun's catalog knows a recording only once its file is registered, and the viewer asks for those of the cards that it
is about to show. A question names its recording in plain bytes. So the viewer talks to a port of ours, which passes
everything on as it is, and before a question it sees to it that what the question names is there. Tens of thousands of
attempts then need no file until somebody looks at them.
"""

from __future__ import annotations

import contextlib
import socket
import threading
from collections.abc import Callable

_PIECE = 1 << 16
_LISTENING = 64
_OVERLAP = 64
"""Longer than the name of any recording."""


class Gateway:
    """Passes connections on a loopback port to another port of this machine.

    Args:
        upstream: The port where the catalog listens.
        before: Called with each piece that comes from a viewer before it is passed on, from several threads. Pieces
            begin with the end of the one before, so that what is cut in two is seen whole.
        host: Where to listen.
        port: Where to listen; 0 for any free one.

    Raises:
        OSError: The port is in use.
    """

    def __init__(
        self, upstream: int, before: Callable[[bytes], None], *, host: str = "127.0.0.1", port: int = 0
    ) -> None:
        self._upstream = upstream
        self._before = before
        self._open: set[socket.socket] = set()
        self._lock = threading.Lock()
        self._listener = socket.create_server((host, port), backlog=_LISTENING)
        self.port: int = self._listener.getsockname()[1]
        threading.Thread(target=self._accept, name="gateway", daemon=True).start()

    def close(self) -> None:
        """Listen no more, and end all connections."""
        # A socket that is closed while a thread waits in accept() would keep the thread: shut it down first.
        with contextlib.suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        with self._lock:
            left = list(self._open)
        for one in left:
            _end(one)

    def _accept(self) -> None:
        while True:
            try:
                viewer, _ = self._listener.accept()
            except OSError:
                return
            try:
                catalog = socket.create_connection(("127.0.0.1", self._upstream))
            except OSError:
                viewer.close()
                continue
            with self._lock:
                self._open |= {viewer, catalog}
            for source, sink, before in ((viewer, catalog, self._before), (catalog, viewer, None)):
                threading.Thread(target=self._pass_on, args=(source, sink, before), daemon=True).start()

    def _pass_on(self, source: socket.socket, sink: socket.socket, before: Callable[[bytes], None] | None) -> None:
        tail = b""
        with contextlib.suppress(OSError):
            while piece := source.recv(_PIECE):
                if before is not None:
                    before(tail + piece)
                    tail = (tail + piece)[-_OVERLAP:]
                sink.sendall(piece)
        # One side has ended: so does the other, and with it the thread that reads there.
        for one in (source, sink):
            _end(one)
        with self._lock:
            self._open -= {source, sink}


def _end(connection: socket.socket) -> None:
    with contextlib.suppress(OSError):
        connection.shutdown(socket.SHUT_RDWR)
    connection.close()
