"""A server of this machine that speaks S3, for tests of datasets in buckets."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from subprocess import DEVNULL, PIPE, Popen
from urllib.request import ProxyHandler, Request, build_opener

import pytest

SERVER = """
import sys
from moto.server import ThreadedMotoServer
server = ThreadedMotoServer("127.0.0.1", 0, verbose=False)
server.start()
print(server.get_host_and_port()[1], flush=True)
sys.stdin.read()
server.stop()
"""


@contextmanager
def s3_server() -> Iterator[str]:
    """Address of a server on the loopback interface only, while the block runs."""
    command = [sys.executable, "-P", "-c", SERVER]
    with Popen(command, stdin=PIPE, stdout=PIPE, stderr=DEVNULL, text=True) as process:
        assert process.stdout is not None
        port = process.stdout.readline().strip()
        assert port.isdigit(), "the S3 server did not start; is moto[server] installed?"
        yield f"http://127.0.0.1:{port}"
        process.kill()


def empty_bucket(server: str, monkeypatch: pytest.MonkeyPatch, *, name: str = "lab") -> None:
    """Make the server hold one empty bucket, and set the environment of people who have one."""
    for variable, value in {
        "AWS_ENDPOINT_URL": server,
        "AWS_ACCESS_KEY_ID": "test",
        "AWS_SECRET_ACCESS_KEY": "test",
        "AWS_REGION": "us-east-1",
        "NO_PROXY": "127.0.0.1",
    }.items():
        monkeypatch.setenv(variable, value)
    opener = build_opener(ProxyHandler({}))
    opener.open(Request(f"{server}/moto-api/reset", method="POST")).close()
    opener.open(Request(f"{server}/{name}", method="PUT")).close()
