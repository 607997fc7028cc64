"""The process of a command ends with its status, whatever native threads still have to say."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from handsight.cli.app import run

IN_FLIGHT = """
import asyncio, atexit, sys
# Registered before Zarr registers the closing of its loop, so done after that.
atexit.register(lambda: print("tidied up, loop", "closed" if loop.is_closed() else "open"))
import icechunk
from zarr.core.buffer import default_buffer_prototype
from zarr.core.sync import _get_loop
from handsight.cli.leaving import leave
from handsight.datasets import GraspRepository

repository = GraspRepository.open(sys.argv[1])
store = repository.root(repository.tip("main")).store

async def read_on() -> None:
    await asyncio.gather(*(store.get("zarr.json", default_buffer_prototype()) for _ in range(300)))

loop = _get_loop()
asyncio.run_coroutine_threadsafe(read_on(), loop)
sys.stderr.write("error: no such ref\\n")
leave(2)
"""


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("leaving") / "grasps"
    assert run(["dataset", "init", str(path)]) == 0
    return path


@pytest.mark.parametrize("attempt", range(3))
def test_what_is_still_read_does_not_change_the_end(dataset: Path, attempt: int) -> None:
    """With ``sys.exit`` a thread of Icechunk panics most of the times, and now and then the process is aborted."""
    command = [sys.executable, "-P", "-c", IN_FLIGHT, str(dataset)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (2, "tidied up, loop open\n", "error: no such ref\n")


def executable(words: str, dataset: Path, *, shell: str) -> tuple[int, str]:
    """Exit status and standard error of the executable, its output going where the shell sends it."""
    program = Path(sys.executable).with_name("handsight")
    line = f"set -o pipefail; '{program}' {words} '{dataset}' {shell}"
    done = subprocess.run(["bash", "-c", line], capture_output=True, text=True, check=False)
    return done.returncode, done.stderr


def test_the_status_of_a_command_is_that_of_its_process(dataset: Path) -> None:
    assert executable("dataset info", dataset, shell="> /dev/null") == (0, "")
    code, said = executable("dataset show --json", dataset, shell="0")
    assert code == 2
    assert said.startswith("error: there is no attempt '0'")


def test_an_output_that_cannot_be_written_is_an_error(dataset: Path) -> None:
    for words in ("dataset info", "dataset info --json"):
        code, said = executable(words, dataset, shell="> /dev/full")
        assert code == 2
        (line,) = said.splitlines()
        assert line.startswith("error: ")
        assert "No space left on device" in line
    assert executable("dataset log", dataset, shell="| true")[1] == ""
