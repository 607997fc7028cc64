"""An emulated rig in a process of its own, on loopback addresses that no other test has."""

from __future__ import annotations

import itertools
import json
import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import pytest
from tests.support.measured_children import measured_children

CONTROL_PORT = 7000
START_LIMIT_S = 60
END_LIMIT_S = 10
_numbers = itertools.count(2)


def free_address() -> str:
    """A loopback address of this process that was not given out before: 127.A.B.N."""
    pid = os.getpid()
    return f"127.{1 + pid // 250 % 250}.{1 + pid % 250}.{next(_numbers)}"


def need_ur_rtde() -> None:
    """Skip where the arm's client library cannot be imported."""
    if find_spec("rtde_control") is None:
        pytest.skip("ur_rtde is not installed: pip install 'handsight[ur10]'")


@dataclass(frozen=True, slots=True)
class RunningRig:
    """One emulator that listens."""

    robot: str
    camera: str
    generation: str
    process: subprocess.Popen[str]

    def do(self, action: str, **values: Any) -> dict[str, Any]:
        """Ask its control port."""
        with socket.create_connection((self.robot, CONTROL_PORT), timeout=10) as connection:
            connection.sendall(json.dumps({"do": action, **values}).encode() + b"\n")
            with connection.makefile(encoding="utf-8") as lines:
                answer: dict[str, Any] = json.loads(lines.readline())
        return answer

    def client(self, program: str, *arguments: str, limit_s: float = 60) -> dict[str, Any]:
        """Run a program with the real client library against it; what it prints last is JSON."""
        done = subprocess.run(
            [sys.executable, "-c", program, self.robot, *arguments],
            capture_output=True,
            text=True,
            timeout=limit_s,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        answer: dict[str, Any] = json.loads(done.stdout.strip().splitlines()[-1])
        return answer


@contextmanager
def running_rig(*options: str, camera: bool = False) -> Iterator[RunningRig]:
    """Start an emulator, and end it with the block.

    Args:
        options: Of ``python -m handsight.collection.ur10.emulator``, beside its addresses.
        camera: Whether it has one; then ``options`` name objects.
    """
    robot, eye = free_address(), free_address()
    command = [sys.executable, "-m", "handsight.collection.ur10.emulator", "--robot", robot]
    command += ["--control", str(CONTROL_PORT), *(("--camera", eye) if camera else ()), *options]
    with measured_children(), subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            ready = process.stdout.readline()
            assert ready, f"the emulator ended with status {process.wait(START_LIMIT_S)}"
            yield RunningRig(robot, eye, json.loads(ready)["generation"], process)
        finally:
            process.terminate()
            try:
                process.wait(END_LIMIT_S)
            finally:
                process.kill()
