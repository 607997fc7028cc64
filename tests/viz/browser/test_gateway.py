"""The door before the catalog: everything passes as it is, and what is asked for is made first."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator

import pytest

from handsight.viz.browser.gateway import Gateway

LIMIT_S = 20.0


@pytest.fixture
def echo() -> Iterator[int]:
    """A port that sends back what it gets, until the connection ends."""
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def serve() -> None:
            while True:
                try:
                    connection, _ = listener.accept()
                except OSError:
                    return
                threading.Thread(target=answer, args=(connection,), daemon=True).start()

        def answer(connection: socket.socket) -> None:
            with connection:
                while data := connection.recv(4096):
                    connection.sendall(data)

        threading.Thread(target=serve, daemon=True).start()
        yield listener.getsockname()[1]
        listener.shutdown(socket.SHUT_RDWR)


def ask(port: int, pieces: list[bytes]) -> bytes:
    with socket.create_connection(("127.0.0.1", port), timeout=LIMIT_S) as connection:
        got = b""
        for piece in pieces:
            connection.sendall(piece)
            expected = len(got) + len(piece)
            while len(got) < expected:
                got += connection.recv(65536)
        return got


def test_what_is_asked_is_seen_before_it_is_answered_and_passes_as_it_is(echo: int) -> None:
    seen: list[bytes] = []
    gateway = Gateway(echo, seen.append)
    try:
        sent = bytes(range(256)) * 1000
        assert ask(gateway.port, [sent]) == sent
        assert len(b"".join(seen)) >= len(sent)
        # The echo came back, so it was seen before: nothing is answered that was not.
        assert ask(gateway.port, [b"first", b"second"]) == b"firstsecond"
    finally:
        gateway.close()


def test_a_name_that_is_cut_in_two_is_seen_whole(echo: int) -> None:
    seen: list[bytes] = []
    gateway = Gateway(echo, seen.append)
    try:
        ask(gateway.port, [b"x" * 100 + b"01M8D7AEHT2D4A36", b"HWXR6AQSTY-000026 and more"])
        assert any(b"01M8D7AEHT2D4A36HWXR6AQSTY-000026" in piece for piece in seen)
    finally:
        gateway.close()


def test_a_door_that_is_closed_ends_its_connections_and_takes_no_more(echo: int) -> None:
    gateway = Gateway(echo, lambda piece: None)
    with socket.create_connection(("127.0.0.1", gateway.port), timeout=LIMIT_S) as connection:
        connection.sendall(b"x")
        assert connection.recv(1) == b"x"
        gateway.close()
        assert connection.recv(1) == b""
    with pytest.raises(OSError, match=r"refused|reset"):
        socket.create_connection(("127.0.0.1", gateway.port), timeout=LIMIT_S)


def test_a_port_in_use_is_refused(echo: int) -> None:
    with pytest.raises(OSError, match="in use"):
        Gateway(echo, lambda piece: None, port=echo)


def test_without_a_catalog_behind_it_connections_end(echo: int) -> None:
    with socket.create_server(("127.0.0.1", 0)) as closed:
        nobody = closed.getsockname()[1]
    gateway = Gateway(nobody, lambda piece: None)
    try:
        with socket.create_connection(("127.0.0.1", gateway.port), timeout=LIMIT_S) as connection:
            assert connection.recv(1) == b""
    finally:
        gateway.close()
