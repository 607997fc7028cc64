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

from handsight.collection.collector import CollectReport, CollectSettings, collect
from handsight.collection.errors import CollectionSettingsError, WorkerDiedError
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


def test_a_killed_worker_costs_no_finished_attempt(whole: Path, tmp_path: Path) -> None:
    def kill_a_worker(attempt: GraspAttempt, held: int) -> None:
        if held == 2:
            os.kill(multiprocessing.active_children()[0].pid or 0, signal.SIGKILL)

    repository = GraspRepository.create(tmp_path / "grasps")
    settings = CollectSettings(attempts=9, seed=11, workers=1)
    with pytest.raises(WorkerDiedError, match="--resume"):
        collect(repository, FACTORY, settings, on_attempt=kill_a_worker)
    assert 2 <= GraspDataset.open(str(tmp_path / "grasps")).info().attempts < 9
    collect(repository, FACTORY, settings, resume=True)
    assert GraspDataset.open(str(tmp_path / "grasps")).digest == GraspDataset.open(str(whole)).digest


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
