"""Several processes, killed processes, forked processes."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from subprocess import PIPE, Popen

import pytest
from tests.support.factories import make_attempt, make_header, record

from handsight.datasets import GraspDataset, GraspRepository, SessionConflictError, SessionWriter

PROGRAM = Path(__file__).parents[2] / "support" / "factories.py"
EVERY = 3


@contextmanager
def recorder(path: Path, *, seed: int, attempts: int, every: int = EVERY) -> Iterator[Popen[str]]:
    """A process that records a session once it is sent a line."""
    command = [sys.executable, "-P", str(PROGRAM), str(path), str(seed), str(attempts), str(every)]
    with Popen(command, stdin=PIPE, stdout=PIPE, text=True) as process:
        try:
            yield process
        finally:
            process.kill()


def start(process: Popen[str]) -> None:
    assert process.stdin is not None
    process.stdin.write("go\n")
    process.stdin.flush()


@pytest.mark.parametrize("last_words", ["appended 0", "appended 2", "committed 3", "appended 5", "committed 9"])
def test_a_killed_writer_loses_nothing_acknowledged_and_is_resumed(tmp_path: Path, last_words: str) -> None:
    """'appended 2' and 'appended 5' are followed by a commit: the kill hits it at any point."""
    header = make_header(seed=4)
    path = tmp_path / "killed"
    repository = GraspRepository.create(path)
    acknowledged = 0
    with recorder(path, seed=4, attempts=100_000) as process:
        start(process)
        assert process.stdout is not None
        for line in process.stdout:
            if line.startswith("committed"):
                acknowledged = int(line.split()[1])
            if line.strip() == last_words:
                process.kill()
                break
        for line in process.stdout:
            if line.startswith("committed"):
                acknowledged = int(line.split()[1])
    kept = len(GraspDataset.open(str(path)).attempts)
    assert kept % EVERY == 0
    assert kept >= acknowledged
    total = kept + 4
    go_on = SessionWriter.resume if kept else SessionWriter.begin
    with go_on(repository, header) as writer:
        assert writer.next_number == kept
        for number in range(kept, total):
            writer.append(make_attempt(header, number))
    record(GraspRepository.create(tmp_path / "whole"), header, (make_attempt(header, i) for i in range(total)))
    assert GraspDataset.open(str(path)).digest == GraspDataset.open(f"{tmp_path}/whole").digest


def test_two_processes_that_commit_at_once_lose_nothing(tmp_path: Path) -> None:
    path = tmp_path / "shared"
    repository = GraspRepository.create(path)
    with (
        recorder(path, seed=1, attempts=12, every=1) as first,
        recorder(path, seed=2, attempts=12, every=1) as second,
    ):
        start(first)
        start(second)
        for process in (first, second):
            output, _ = process.communicate(timeout=120)
            assert process.returncode == 0
            assert output.count("committed") == 12
    expected = GraspRepository.create(tmp_path / "expected")
    for seed in (1, 2):
        header = make_header(seed=seed)
        record(expected, header, [make_attempt(header, number) for number in range(12)])
    assert len(repository.log()) == 1 + 24
    assert GraspDataset.open(str(path)).digest == GraspDataset.open(f"{tmp_path}/expected").digest


def test_commits_of_two_writers_interleave(repository: GraspRepository, monkeypatch: pytest.MonkeyPatch) -> None:
    """The second writer starts each change before the first commits, so that each of its commits is rebased."""
    one, two = (SessionWriter.begin(GraspRepository.open(repository.path), make_header(seed=seed)) for seed in (1, 2))
    for number in range(3):
        for writer in (one, two):
            writer.append(make_attempt(writer.header, number))
        stale = two.repository.writable("main")
        one.commit()
        with monkeypatch.context() as patch:
            patch.setattr(two.repository, "writable", lambda branch, change=stale: change)
            two.commit()
    assert [session.attempts for session in GraspDataset.open(str(repository.path)).sessions] == [3, 3]
    with pytest.raises(SessionConflictError):
        SessionWriter.begin(repository, make_header(seed=2))


FORK = """
import os, sys
from handsight.datasets import ForkedProcessError, GraspDataset, SessionWriter
sys.path.insert(0, {tests!r})
from factories import make_attempt, make_header
dataset = GraspDataset.open({path!r})
identity = dataset.attempts.index[0]
writer = SessionWriter.resume(dataset.repository, make_header())
uses = [
    lambda: dataset.attempt(identity),
    lambda: list(dataset.frames("overhead")),
    lambda: GraspDataset(dataset.repository, ref="main"),
    lambda: writer.append(make_attempt(writer.header, 1)),
    lambda: dataset.repository.log(),
    lambda: dataset.repository.release("v1"),
]
child = os.fork()
if child == 0:
    refused = 0
    for use in uses:
        try:
            use()
        except ForkedProcessError as error:
            assert "'spawn' or 'forkserver'" in str(error)
            refused += 1
    os._exit(0 if refused == len(uses) else 1)
sys.exit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""


def test_a_forked_child_is_refused_instead_of_hanging(repository: GraspRepository) -> None:
    header = make_header()
    record(repository, header, [make_attempt(header, 0)])
    program = FORK.format(path=str(repository.path), tests=str(PROGRAM.parent))
    command = [sys.executable, "-P", "-c", program]
    answer = subprocess.run(command, timeout=60, capture_output=True, text=True, check=False)
    assert answer.returncode == 0, answer.stderr
