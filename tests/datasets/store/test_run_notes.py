"""Notes of runs beside a dataset: read where they are whole, and in nobody's way."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.support.fuzz_mutations import mutate_bytes
from tests.support.small_disk import files_of_at_most
from tests.support.versions import grow

from handsight.datasets import GraspDataset, GraspRepository, collect_garbage, verify
from handsight.datasets.reading.info import bytes_stored
from handsight.datasets.store.run_notes import NOTES_FOLDER, NotedVersion, RunNote, notes_of, write_note

NOTE = RunNote(
    run="/lab/runs/rgbd",
    weights_sha256="ab" * 32,
    created="2026-03-01T12:00:00+00:00",
    versions=(
        NotedVersion(ref="v1", snapshot="ABC", view="overhead"),
        NotedVersion(ref="v1", snapshot="ABC", view="pregrasp"),
    ),
)


@pytest.fixture
def repository(tmp_path: Path) -> GraspRepository:
    made = GraspRepository.create(tmp_path / "grasps")
    grow(made, to=2)
    return made


def test_notes_are_of_a_snapshot_and_the_oldest_first(repository: GraspRepository) -> None:
    later = replace(NOTE, run="/lab/runs/again", created="2026-03-02T12:00:00+00:00")  # The same weights elsewhere.
    other = replace(NOTE, run="/x", versions=(NotedVersion(ref="main", snapshot="XYZ", view="overhead"),))
    assert notes_of(repository, "ABC") == []
    for note in (later, NOTE, other, NOTE):
        write_note(repository, note)
    assert notes_of(repository, "ABC") == [NOTE, later]
    assert notes_of(repository, "XYZ") == [other]
    assert len(list((repository.side_folder / NOTES_FOLDER).iterdir())) == 3


def test_a_dataset_is_not_changed_by_notes(repository: GraspRepository) -> None:
    before = bytes_stored(repository), repository.branches()
    write_note(repository, NOTE)
    left = repository.side_folder / NOTES_FOLDER / ".x.unfinished-01234567.json"
    for path in (left, left.with_name(f"{left.name}.lock")):  # As a killed process leaves it.
        path.write_text("")
    collect_garbage(repository, dry_run=False)
    assert (bytes_stored(repository), repository.branches()) == before
    assert verify(GraspDataset(repository, ref="main")).faults == {}
    assert notes_of(repository, "ABC") == [NOTE]
    assert not left.exists()


def test_a_note_that_is_damaged_is_left_out(repository: GraspRepository) -> None:
    write_note(repository, NOTE)
    write_note(repository, replace(NOTE, run="/other"))
    path = next((repository.side_folder / NOTES_FOLDER).iterdir())
    data = path.read_bytes()
    kept = replace(NOTE, run="/other" if json.loads(data)["run"] == NOTE.run else NOTE.run)
    texts = ("", "null", "[]", "{}", "[" * 100_000, '{"versions": 1}', '{"versions": [1]}', "\ud800", "x" * 100_000)
    for text in texts:
        path.write_bytes(text.encode(errors="surrogatepass"))
        assert notes_of(repository, "ABC") == [kept]
    for changes in ({"weights_sha256": "abc"}, {"run": 1}, {"run": "a\0b"}, {"created": None}, {"run": "x" * 5000}):
        path.write_text(json.dumps({**json.loads(data), **changes}))
        assert notes_of(repository, "ABC") == [kept]
    for seed in range(100):
        path.write_bytes(mutate_bytes(data, np.random.default_rng(seed)))
        assert kept in notes_of(repository, "ABC")


def test_what_is_in_the_way_is_an_error_to_write_and_none_to_read(repository: GraspRepository) -> None:
    with files_of_at_most(0), pytest.raises(OSError, match="File too large"):
        write_note(repository, NOTE)
    assert notes_of(repository, "ABC") == []
    folder = repository.side_folder / NOTES_FOLDER
    for path in folder.iterdir():
        path.unlink()
    folder.rmdir()
    folder.write_text("in the way")
    with pytest.raises(FileExistsError):
        write_note(repository, NOTE)
    assert notes_of(repository, "ABC") == []
