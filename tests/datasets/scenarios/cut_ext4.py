"""Cuts the power of a real ext4 file system under a writer, again and again. Needs root, losetup and mkfs.ext4.

Run as ``python -P tests/datasets/scenarios/cut_ext4.py [CUTS] [--without-sync]``. A session is recorded in a file
system inside a file. At random moments the writer is stopped and the file copied: the copy holds what had reached the
disk, and nothing of what the kernel still kept in memory, which it is told to keep for minutes. The copy is mounted,
which replays the journal as after a power cut, and must hold every attempt whose commit had been acknowledged, whole,
and take another release. ``--without-sync`` shows what becomes of a dataset that leaves syncing to Icechunk.

Not collected by pytest, whose runs have no root; ``test_power_cuts.py`` cuts the power of a modelled disk instead,
which also loses what no ext4 ever would.
"""

from __future__ import annotations

import argparse
import random
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from subprocess import PIPE, Popen

from handsight.datasets import DatasetError, GraspDataset, GraspRepository, verify

FACTORIES = Path(__file__).parents[2] / "support" / "factories.py"
UNSYNCED = """
import os, runpy, sys
from handsight.datasets.store import branches, icechunk_engine, layout, repository
for module in (branches, icechunk_engine, layout, repository):
    module.sync_file_system = lambda path: None
os.fsync = lambda descriptor: None
sys.argv = sys.argv[1:]
runpy.run_path(sys.argv[0], run_name="__main__")
"""
ATTEMPTS = 10_000
CUTS_A_SESSION = 12
DISK_BYTES = 96 << 20


def main(cuts: int, *, synced: bool) -> int:
    """Cut so many times, print what became of the datasets, and return how many had lost something."""
    rng = random.Random(0)
    done = acknowledged = 0
    damaged: list[str] = []
    with tempfile.TemporaryDirectory(prefix="handsight-cuts-") as name:
        while done < cuts:
            folder = Path(tempfile.mkdtemp(dir=name))
            for committed, fault in _cut_one_session(
                folder, done, min(CUTS_A_SESSION, cuts - done), rng, synced=synced
            ):
                done += 1
                acknowledged += committed
                damaged += [fault] if fault else []
            print(f"{done} cuts, {acknowledged} acknowledged commits looked for, {len(damaged)} cuts with damage")
    for fault in sorted(set(damaged)):
        print(f"{damaged.count(fault)}x {fault}")
    return len(damaged)


def _cut_one_session(
    folder: Path, seed: int, cuts: int, rng: random.Random, *, synced: bool
) -> Iterator[tuple[int, str | None]]:
    disk, copy, mounted = folder / "disk", folder / "copy", folder / "mounted"
    with disk.open("wb") as file:
        file.truncate(DISK_BYTES)
    _call("mkfs.ext4", "-q", disk)
    with _mounted(disk, mounted), _writer(mounted / "grasps", seed, synced=synced) as (process, committed):
        for _ in range(cuts):
            time.sleep(rng.uniform(0.02, 0.35))
            process.send_signal(signal.SIGSTOP)
            expected = committed[-1]
            _call("cp", "--sparse=always", disk, copy)
            process.send_signal(signal.SIGCONT)
            with _mounted(copy, folder / "after"):
                yield expected, _fault(folder / "after" / "grasps", expected)


def _fault(path: Path, expected: int) -> str | None:
    """What is wrong with the dataset after a cut."""
    try:
        dataset = GraspDataset.open(str(path))
        if not verify(dataset).ok:
            return "an attempt is corrupt"
        if len(dataset.attempts) < expected:
            return "an acknowledged attempt is lost"
        GraspRepository.open(path).release("after")
    except (DatasetError, OSError) as error:
        return f"{type(error).__name__}: {str(error).replace(str(path), 'DATASET')}"
    return None


@contextmanager
def _mounted(disk: Path, place: Path) -> Iterator[None]:
    place.mkdir(exist_ok=True)
    device = _call("losetup", "--find", "--show", disk)
    try:
        # ext4 writes by itself only every 300 s.
        _call("mount", "-o", "commit=300", device, place)
        try:
            yield
        finally:
            _call("umount", "--lazy", place)
    finally:
        _call("losetup", "--detach", device)


@contextmanager
def _writer(path: Path, seed: int, *, synced: bool) -> Iterator[tuple[Popen[str], list[int]]]:
    """A process that commits one attempt after the other, and the numbers of attempts that it has acknowledged."""
    GraspRepository.create(path)
    _call("sync", "--file-system", path)
    program = ["-P", str(FACTORIES)] if synced else ["-c", UNSYNCED, str(FACTORIES)]
    command = [sys.executable, *program, str(path), str(seed), str(ATTEMPTS), "1"]
    committed: list[int] = []
    first = threading.Event()

    def follow() -> None:
        assert process.stdout is not None
        for line in process.stdout:
            if line.startswith("committed"):
                committed.append(int(line.split()[1]))
                first.set()

    with Popen(command, stdin=PIPE, stdout=PIPE, stderr=subprocess.DEVNULL, text=True) as process:
        threading.Thread(target=follow, daemon=True).start()
        assert process.stdin is not None
        process.stdin.write("go\n")
        process.stdin.flush()
        assert first.wait(60), "the writer did not commit"
        try:
            yield process, committed
        finally:
            process.kill()


def _call(*command: object) -> str:
    words = [str(word) for word in command]
    return subprocess.run(words, check=True, capture_output=True, text=True).stdout.strip()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cuts", type=int, nargs="?", default=60)
    parser.add_argument("--without-sync", action="store_true")
    chosen = parser.parse_args()
    raise SystemExit(min(1, main(chosen.cuts, synced=not chosen.without_sync)))
