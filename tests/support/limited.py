"""``python -P limited.py LIMIT FOLDER``: what commands and readers say where the machine refuses what they need.

Commands are run once without the limit before, because modules are files too.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import resource
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

from handsight.cli.app import run
from handsight.datasets import GraspDataset, doctor, verify

NOBODY = 65534
IMPORTS = ("grasps.hdf5", "grasps.zarr", "lerobot", "images")


def few_files() -> None:
    """No descriptor is left."""
    lowest = os.dup(0)
    os.close(lowest)
    resource.setrlimit(resource.RLIMIT_NOFILE, (lowest, lowest))


def no_threads() -> None:
    """No thread can be started. The system does not hold root to that."""
    _become_nobody()
    resource.setrlimit(resource.RLIMIT_NPROC, (1, 1))


def little_memory() -> None:
    """A megabyte is left."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    limit = pages * resource.getpagesize() + (1 << 20)
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))


def no_rights() -> None:
    """Files that only others may read. Root may read any."""
    _become_nobody()


LIMITS = {one.__name__: one for one in (few_files, no_threads, little_memory, no_rights)}


def _become_nobody() -> None:
    if os.getuid() == 0:
        os.setuid(NOBODY)


def said(*words: str) -> tuple[int, str]:
    """Exit status of a command, and what it wrote to standard error."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        status = run(words)
    return status, err.getvalue()


def raised(read: Callable[[], object]) -> str:
    """What a reader raises, or returns."""
    try:
        return repr(read())
    except Exception as error:
        return f"{type(error).__name__}: {error}"


def main() -> None:
    """Print one JSON object: exit status and message of every command, and what every reader comes to."""
    limit, folder = LIMITS[sys.argv[1]], Path(sys.argv[2])
    grasps = str(folder / "grasps")
    commands = [
        ("dataset", "verify", grasps, "--jobs", "1"),
        ("dataset", "verify", grasps, "--all", "--jobs", "1"),
        ("dataset", "doctor", grasps, "--deep"),
        ("dataset", "repair", grasps, "--branch", "mended", "--author", "anna"),
    ]
    if limit is few_files:
        commands += [("dataset", "import", str(folder / name), str(folder / "new"), "--dry-run") for name in IMPORTS]
    for words in commands:
        status, _ = said(*words)
        assert status in (0, 1), words
    readers: list[Callable[[GraspDataset], object]] = [lambda one: verify(one).ok, lambda one: doctor(one).ok]
    if limit is little_memory:
        readers = []  # Rust and asyncio may end or hang for want of memory in the middle of a read.
    opened = [GraspDataset.open(grasps) for _ in readers]
    limit()
    found = {
        "commands": [said(*words) for words in commands],
        "readers": [raised(partial(read, one)) for read, one in zip(readers, opened, strict=True)],
    }
    sys.stdout.write(json.dumps(found) + "\n")
    sys.stdout.flush()
    # Zarr's threads cannot be told to end where none can be started.
    os._exit(0)


if __name__ == "__main__":
    main()
