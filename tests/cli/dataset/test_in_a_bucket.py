"""Whatever is typed for a dataset in a folder does the same for one in a bucket."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.support.factories import make_attempt, make_header, record
from tests.support.s3_server import empty_bucket, s3_server

from handsight.cli.app import run
from handsight.datasets import GraspRepository
from handsight.datasets.exchange.merge import merge
from handsight.datasets.reading.reader import GraspDataset

BUCKET = "s3://lab/week/grasps"

COMMANDS = (
    "release {d} v1 --message first",
    "release {d} v1",
    "ls {d} --sort contact_force_n --where outcome!='aborted' --json",
    "exclude {d} --where outcome=='aborted' --reason aborted",
    "relabel {d} --where outcome=='held' --to failure --reason unsure",
    "relabel {d} --where outcome=='held' --to maybe --reason unsure",
    "undo {d}",
    "decisions {d} --json",
    "filter {d} held --where outcome=='held'",
    "ls {d} --filter held --ids",
    "filter {d} --json",
    "folds {d} by-session --by session --count 2",
    "folds {d} --json",
    "diff {d}@v1 {d} --json",
    "branch {d} trial",
    "exclude {d}@trial --where outcome=='held' --reason trial",
    "revert {d}@trial v1",
    "diff {d}@v1 {d}@trial --json",
    "branch {d} trial --delete --force",
    "branch {d} --json",
    "stats {d} --json",
    "doctor {d} --json",
    "verify {d}",
    "log {d}@v1 --json",
    "expire {d} --older-than 0m --dry-run",
    "gc {d} --older-than 0m",
    "verify {d}@v1",
    "show {d}@nowhere 0",
)


@pytest.fixture(scope="module")
def server() -> Iterator[str]:
    with s3_server() as address:
        yield address


def typed(command: str, dataset: str, capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    """Exit status and output, without what differs between any two datasets."""
    status = run(["dataset", *(part.format(d=dataset) for part in command.split())])
    text = "".join(capsys.readouterr()).replace(dataset, "DATASET")
    text = re.sub(r"\b[0-9A-HJKMNP-TV-Z]{20}\b", "SNAPSHOT", text)
    return status, re.sub(r"\d{4}-\d\d-\d\d[T ][\d:.]+(\+00:00)?", "TIME", text)


def test_commands_do_the_same_in_a_bucket(
    server: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    empty_bucket(server, monkeypatch)
    monkeypatch.setenv("HANDSIGHT_CACHE", str(tmp_path / "cache"))
    folder = str(tmp_path / "grasps")
    source = GraspRepository.create(tmp_path / "source")
    for seed in (1, 2):
        header = make_header(seed=seed, width=64, height=48)
        record(source, header, [make_attempt(header, number) for number in range(8)])
    for place in (folder, BUCKET):  # One history, with the same ids.
        merge(GraspDataset(source, ref="main"), GraspRepository.create(place))
    outcomes = {command: tuple(typed(command, place, capsys) for place in (folder, BUCKET)) for command in COMMANDS}
    for command, (local, remote) in outcomes.items():
        assert remote == local, command
    assert {status for (status, _), _ in outcomes.values()} == {0, 1, 2}
