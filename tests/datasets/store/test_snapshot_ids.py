"""Snapshots by the beginnings of their ids, as ``log`` prints them."""

from __future__ import annotations

import re

import pytest
from tests.support.versions import grow

from handsight.datasets import GraspRepository, RefNotFoundError, create_branch
from handsight.datasets.curation.saved_filters import save_filter
from handsight.datasets.store import snapshot_ids


def test_a_unique_beginning_is_the_snapshot(repository: GraspRepository) -> None:
    tip = grow(repository, 2)
    create_branch(repository, "dev")
    for entry in repository.log():
        for text in (entry.snapshot_id[:8], entry.snapshot_id[:19].lower(), entry.snapshot_id):
            assert repository.resolve(text) == entry.snapshot_id
    assert repository.resolve("main") == tip


def test_names_go_before_beginnings(repository: GraspRepository) -> None:
    first = repository.resolve("main")
    grow(repository, 2)
    repository.release(first[:8])
    assert repository.resolve(first[:8]) == repository.resolve("main") != first


@pytest.mark.parametrize("text", ["ABC", "0" * 8, "0" * 21, "no-such", ""])
def test_what_begins_nothing_names_nothing(repository: GraspRepository, text: str) -> None:
    with pytest.raises(RefNotFoundError, match=r"branches: main"):
        repository.resolve(text)


def test_a_beginning_of_several_is_refused_with_some_of_them(
    repository: GraspRepository, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Ids are random: by the 33rd, two begin with the same character.
    monkeypatch.setattr(snapshot_ids, "_BEGINNING", re.compile("."))
    ids: dict[str, str] = {}
    for number in range(33):
        save_filter(repository, f"f{number}", "success", author="jo")
        tip = repository.tip("main")
        if tip[0] in ids:
            break
        ids[tip[0]] = tip
    with pytest.raises(RefNotFoundError, match=rf"'{tip[0]}' in .* can be any of \d+ snapshots.*write out more"):
        repository.resolve(tip[0])
