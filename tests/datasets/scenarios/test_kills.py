"""A writer that is killed at any moment loses nothing that it was told was stored."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from tests.support.factories import difference, make_attempt, make_header, record

from handsight.datasets import GraspDataset, GraspRepository, verify

KILLS = int(os.environ.get("HANDSIGHT_KILLS", "12"))
PER_SESSION = 10
WRITERS = 8

# One process that never opens a dataset itself forks the writers: starting an interpreter for each would take longer
# than everything else. A writer reports each commit once it is acknowledged.
KILLER = """
import os, random, signal, sys, time
sys.path.insert(0, {tests!r})
from factories import make_attempt, make_header
from handsight.datasets import GraspRepository, SessionNotFoundError, SessionWriter

def write(seed, report):
    header = make_header(seed=seed)
    repository = GraspRepository.open({path!r})
    try:
        writer = SessionWriter.resume(repository, header)
    except SessionNotFoundError:
        writer = SessionWriter.begin(repository, header)
    while True:
        for _ in range(random.randint(1, 3)):
            writer.append(make_attempt(header, writer.next_number))
        writer.commit()
        os.write(report, b"%d\\n" % writer.next_number)

def start(seed):
    listen, report = os.pipe()
    child = os.fork()
    if child == 0:
        write(seed, report)
    os.close(report)
    return child, listen

# How long a busy machine takes to the first commit: writers killed before theirs would show nothing.
began = time.monotonic()
child, listen = start(10**6)
os.read(listen, 1)
first_s = time.monotonic() - began
os.kill(child, signal.SIGKILL)
os.waitpid(child, 0)

random.seed({kills})
for kill in range({kills}):
    seed = kill // {per_session}
    child, listen = start(seed)
    time.sleep(random.uniform(0.0, max(0.4, 2 * first_s)))  # The moment is the point: any will do.
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    lines = os.fdopen(listen).read().split()
    print(seed, lines[-1] if lines else 0, flush=True)
    sys.stdin.readline()
"""


@pytest.mark.timeout(1800)
def test_a_writer_killed_at_random_loses_nothing_acknowledged(tmp_path: Path) -> None:
    """HANDSIGHT_KILLS sets how many writers are killed."""
    path = tmp_path / "killed"
    GraspRepository.create(path)
    program = KILLER.format(
        tests=str(Path(__file__).parents[2] / "support"), path=str(path), kills=KILLS, per_session=PER_SESSION
    )
    acknowledged: dict[int, int] = {}
    lost = []
    command = [sys.executable, "-P", "-c", program]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as killer:
        assert killer.stdin is not None
        assert killer.stdout is not None
        for line in killer.stdout:
            seed, stored = map(int, line.split())
            acknowledged[seed] = max(stored, acknowledged.get(seed, 0))
            sizes = {one.header.seed: one.attempts for one in GraspDataset.open(str(path)).sessions}
            if any(sizes.get(known, 0) < count for known, count in acknowledged.items()):
                lost.append((line, sizes))
            killer.stdin.write("go\n")
            killer.stdin.flush()
    assert killer.returncode == 0
    assert lost == []
    assert sum(acknowledged.values()) > 0
    dataset = GraspDataset.open(str(path))
    assert verify(dataset).ok
    for session in dataset.sessions:
        last = dataset.attempts.index[dataset.attempts["session"] == session.ulid][-1]
        expected = make_attempt(session.header, session.attempts - 1)
        assert difference(dataset.attempt(last), expected) is None


def test_eight_writers_at_once_lose_nothing(tmp_path: Path) -> None:
    path = tmp_path / "shared"
    GraspRepository.create(path)
    program = Path(__file__).parents[2] / "support" / "factories.py"
    size = 9
    command = [sys.executable, "-P", str(program), str(path)]
    writers = [
        subprocess.Popen(
            [*command, str(seed), str(size), "1"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        for seed in range(WRITERS)
    ]
    for writer in writers:
        assert writer.stdin is not None
        writer.stdin.write("go\n")
        writer.stdin.flush()
    for writer in writers:
        output, _ = writer.communicate(timeout=200)
        assert writer.returncode == 0
        assert output.count("committed") == size
    expected = GraspRepository.create(tmp_path / "expected")
    for seed in range(WRITERS):
        header = make_header(seed=seed)
        record(expected, header, [make_attempt(header, number) for number in range(size)], every=size)
    dataset = GraspDataset.open(str(path))
    assert dataset.digest == GraspDataset.open(f"{tmp_path}/expected").digest
    assert verify(dataset).checked == WRITERS * size
