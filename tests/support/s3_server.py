"""A server of this machine that speaks S3, for tests of datasets in buckets, and what it was asked for."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from subprocess import DEVNULL, PIPE, Popen
from urllib.request import OpenerDirector, ProxyHandler, Request, build_opener

import pytest

SERVER = """
import json
import sys
from threading import Thread
from moto.moto_server.werkzeug_app import DomainDispatcherApplication, MotoRequestHandler, create_backend_app
from werkzeug.serving import make_server
app = DomainDispatcherApplication(create_backend_app)
asked = []

def counting(environ, start_response):
    path, query = environ["PATH_INFO"], environ["QUERY_STRING"]
    if path == "/asked":
        said, asked[:] = json.dumps(asked).encode(), []
        start_response("200 OK", [("Content-Length", str(len(said)))])
        return [said]
    asked.append(f"{environ['REQUEST_METHOD']} {path}" + (f"?{query}" if query else ""))
    return app(environ, start_response)

server = make_server("127.0.0.1", 0, counting, True, request_handler=MotoRequestHandler)
Thread(target=server.serve_forever, daemon=True).start()
print(server.server_address[1], flush=True)
sys.stdin.read()
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
    opener = _opener()
    opener.open(Request(f"{server}/moto-api/reset", method="POST")).close()
    opener.open(Request(f"{server}/{name}", method="PUT")).close()


def requests_since(server: str) -> list[str]:
    """What the server was asked for since the last call, each as ``METHOD /path?query``."""
    with _opener().open(f"{server}/asked") as answer:
        asked: list[str] = json.loads(answer.read())
    return asked


def _opener() -> OpenerDirector:
    return build_opener(ProxyHandler({}))
