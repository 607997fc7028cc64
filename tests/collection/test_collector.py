"""Sessions collected with real workers: order, resumption, conflicts, deaths."""

from __future__ import annotations

import multiprocessing
import os
import select
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from handsight.cli.app import run
from handsight.collection.collector import CollectReport, CollectSettings, collect
from handsight.collection.errors import CollectionSettingsError
from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.station import SimStationFactory
from handsight.datasets import GraspDataset, GraspRepository, SessionConflictError
from handsight.datasets.records import GraspAttempt

FACTORY = SimStationFactory(config=SimConfig())


def collected(path: Path, *, resume: bool = False, **settings: Any) -> CollectReport:
    return collect(GraspRepository.open_or_create(path), FACTORY, CollectSettings(**settings), resume=resume)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Nine attempts by one worker, committed by fours."""
    path = tmp_path_factory.mktemp("whole") / "grasps"
    collected(path, attempts=9, seed=11, workers=1, commit_every=4)
    return path


def test_the_digest_does_not_depend_on_workers_or_commits(whole: Path, tmp_path: Path) -> None:
    collected(tmp_path / "two", attempts=9, seed=11, workers=2, commit_every=2)
    assert GraspDataset.open(str(tmp_path / "two")).digest == GraspDataset.open(str(whole)).digest


def test_another_seed_gives_another_digest(whole: Path, tmp_path: Path) -> None:
    collected(tmp_path / "other", attempts=9, seed=12, workers=2)
    assert GraspDataset.open(str(tmp_path / "other")).digest != GraspDataset.open(str(whole)).digest


def test_a_session_cut_short_is_resumed_to_the_same_content(whole: Path, tmp_path: Path) -> None:
    collected(tmp_path / "cut", attempts=4, seed=11, workers=1)
    report = collected(tmp_path / "cut", attempts=9, seed=11, workers=2, resume=True)
    assert (report.resumed_from, report.attempts) == (4, 9)
    assert GraspDataset.open(str(tmp_path / "cut")).digest == GraspDataset.open(str(whole)).digest
    again = collected(tmp_path / "cut", attempts=9, seed=11, workers=1, resume=True)
    assert (again.resumed_from, again.attempts, again.successes) == (9, 9, 0)


def test_resume_without_anything_to_resume_begins(tmp_path: Path) -> None:
    assert collected(tmp_path / "new", attempts=2, seed=1, workers=1, resume=True).resumed_from == 0


def test_the_same_session_twice_is_refused_and_changes_nothing(whole: Path) -> None:
    before = GraspDataset.open(str(whole)).snapshot_id
    with pytest.raises(SessionConflictError, match="--resume"):
        collected(whole, attempts=9, seed=11, workers=1)
    assert GraspDataset.open(str(whole)).snapshot_id == before


def test_an_interruption_keeps_every_finished_attempt(whole: Path, tmp_path: Path) -> None:
    """Ctrl-C between two commits: what was appended is committed, and going on ends in the same bytes."""

    def interrupt(attempt: GraspAttempt, held: int) -> None:
        if held == 3:
            raise KeyboardInterrupt

    repository = GraspRepository.create(tmp_path / "cut")
    settings = CollectSettings(attempts=9, seed=11, workers=2, commit_every=100)
    with pytest.raises(KeyboardInterrupt):
        collect(repository, FACTORY, settings, on_attempt=interrupt)
    assert GraspDataset.open(str(tmp_path / "cut")).info().attempts == 3
    collected(tmp_path / "cut", attempts=9, seed=11, workers=1, resume=True)
    assert GraspDataset.open(str(tmp_path / "cut")).digest == GraspDataset.open(str(whole)).digest


@pytest.mark.parametrize("workers", [1, 2])
def test_a_killed_worker_is_replaced_and_nobody_can_tell(whole: Path, tmp_path: Path, workers: int) -> None:
    killed = []

    def kill_a_worker(attempt: GraspAttempt, held: int) -> None:
        if held == 2:
            killed.append(multiprocessing.active_children()[0])
            os.kill(killed[0].pid or 0, signal.SIGKILL)

    repository = GraspRepository.create(tmp_path / "grasps")
    settings = CollectSettings(attempts=9, seed=11, workers=workers)
    assert collect(repository, FACTORY, settings, on_attempt=kill_a_worker).attempts == 9
    assert killed[0].exitcode == -signal.SIGKILL
    assert GraspDataset.open(str(tmp_path / "grasps")).digest == GraspDataset.open(str(whole)).digest


def test_an_attempt_that_kills_its_worker_twice_is_still_made(whole: Path, tmp_path: Path) -> None:
    said, deaths = doomed_collection(tmp_path, deaths=2)
    assert (said, deaths) == ("9", 2)
    assert GraspDataset.open(str(tmp_path / "grasps")).digest == GraspDataset.open(str(whole)).digest


def test_an_attempt_that_always_kills_its_worker_ends_the_session(whole: Path, tmp_path: Path) -> None:
    said, deaths = doomed_collection(tmp_path, deaths=100)
    assert said.startswith("attempt 5: 3 workers in a row ended")
    assert "5 attempts before it committed: go on with --resume" in said
    assert deaths == 3
    assert GraspDataset.open(str(tmp_path / "grasps")).info().attempts == 5
    report = collected(tmp_path / "grasps", attempts=9, seed=11, workers=1, resume=True)
    assert (report.resumed_from, report.attempts) == (5, 9)
    assert GraspDataset.open(str(tmp_path / "grasps")).digest == GraspDataset.open(str(whole)).digest


def doomed_collection(folder: Path, *, deaths: int) -> tuple[str, int]:
    """What the program of that name prints, and how often a worker of it was killed."""
    (folder / "marks").mkdir()
    program = Path(__file__).parents[1] / "support" / "doomed_collection.py"
    command = [sys.executable, "-P", str(program), str(folder / "grasps"), str(folder / "marks"), str(deaths)]
    program_run = subprocess.run(command, check=True, capture_output=True, text=True, timeout=200)
    return program_run.stdout.strip(), len(list((folder / "marks").iterdir()))


LIMITED_COMMAND = """
import resource
from handsight.cli.app import main
resource.setrlimit(resource.RLIMIT_FSIZE, (2**16, 2**16))
main()
"""
"""The command on a file system that takes no file of the size of a picture. A limit on files stands in for a full disk:
it fails the same writes and needs neither a file system of one's own nor the rights to mount one."""


def test_a_full_disk_leaves_the_last_commit_and_is_resumed(
    whole: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    grasps = str(tmp_path / "grasps")
    words = ["collect", "sim", grasps, "--objects", FACTORY.config.objects, "--seed", "11", "-w", "2"]
    assert run([*words, "-n", "4"]) == 0
    before = GraspDataset.open(grasps)
    command = [sys.executable, "-P", "-c", LIMITED_COMMAND, *words, "-n", "9", "--resume"]
    full = subprocess.run(command, check=False, capture_output=True, text=True, timeout=200)
    assert full.returncode == 2
    (line,) = full.stderr.splitlines()
    assert line.startswith(f"error: cannot write to {grasps}: ")
    assert "check that the disk is writable and not full" in line
    after = GraspDataset.open(grasps)
    assert (after.snapshot_id, after.digest) == (before.snapshot_id, before.digest)
    assert run(["dataset", "verify", grasps]) == 0
    assert run([*words, "-n", "9", "--resume"]) == 0
    assert GraspDataset.open(grasps).digest == GraspDataset.open(str(whole)).digest
    assert capsys.readouterr().err == ""


COLLECT_AND_TELL = """
import multiprocessing, sys
from handsight.collection.collector import CollectSettings, collect
from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.station import SimStationFactory
from handsight.datasets import GraspRepository

def tell(attempt, held):
    print(held, *[child.pid for child in multiprocessing.active_children()], flush=True)

if __name__ == "__main__":
    settings = CollectSettings(attempts=9, seed=11, workers=2, commit_every=2)
    factory = SimStationFactory(config=SimConfig())
    collect(GraspRepository.open_or_create(sys.argv[1]), factory, settings, on_attempt=tell)
"""


def test_a_killed_writer_takes_its_workers_along_and_is_resumed(whole: Path, tmp_path: Path) -> None:
    script = tmp_path / "collect_and_tell.py"
    script.write_text(COLLECT_AND_TELL)
    with subprocess.Popen([sys.executable, "-P", script, tmp_path / "grasps"], stdout=subprocess.PIPE) as writer:
        assert writer.stdout is not None
        told = [writer.stdout.readline().split() for _ in range(3)][-1]
        gone = select.poll()
        for worker in map(int, told[1:]):
            gone.register(os.pidfd_open(worker), select.POLLIN)
        writer.kill()
    ended = 0
    while ended < len(told) - 1:
        ready = gone.poll(60_000)
        assert ready, "workers go on without their writer"
        for descriptor, _ in ready:
            gone.unregister(descriptor)
            os.close(descriptor)
            ended += 1
    assert 2 <= GraspDataset.open(str(tmp_path / "grasps")).info().attempts <= 4
    collected(tmp_path / "grasps", attempts=9, seed=11, workers=1, resume=True)
    assert GraspDataset.open(str(tmp_path / "grasps")).digest == GraspDataset.open(str(whole)).digest


def test_bad_settings_report_every_fault() -> None:
    with pytest.raises(CollectionSettingsError) as caught:
        CollectSettings(attempts=-5, seed=-1, workers=0, commit_every=0)
    for part in ("attempts is -5", "seed is -1", "workers is 0", "commit_every is 0"):
        assert part in str(caught.value)
