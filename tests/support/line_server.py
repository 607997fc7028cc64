"""A server of a line or byte protocol on a loopback address, answered by a function, for clients under test."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Answer = Callable[[bytes], bytes | None]
"""What to send for what came; None closes the connection."""


@contextmanager
def answering(answer: Answer, *, greeting: bytes = b"") -> Iterator[tuple[str, int]]:
    """Serve until the block ends; gives address and port."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        ended = threading.Event()
        thread = threading.Thread(target=_accept, args=(server, answer, greeting, ended))
        thread.start()
        try:
            address, port = server.getsockname()[:2]
            yield str(address), int(port)
        finally:
            ended.set()
            # Wakes the thread that waits for connections.
            socket.create_connection(server.getsockname()[:2]).close()
            thread.join()


def _accept(server: socket.socket, answer: Answer, greeting: bytes, ended: threading.Event) -> None:
    threads: list[threading.Thread] = []
    while not ended.is_set():
        connection, _ = server.accept()
        threads.append(threading.Thread(target=_serve, args=(connection, answer, greeting, ended)))
        threads[-1].start()
    for thread in threads:
        thread.join()


def _serve(connection: socket.socket, answer: Answer, greeting: bytes, ended: threading.Event) -> None:
    connection.settimeout(0.05)
    with connection:
        connection.sendall(greeting)
        while not ended.is_set():
            try:
                got = connection.recv(4096)
            except TimeoutError:
                continue
            except OSError:
                return
            said = answer(got) if got else None
            if said is None:
                return
            connection.sendall(said)
