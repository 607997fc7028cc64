"""A power cut at any moment loses nothing that was acknowledged."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from tests.support.factories import make_attempt, make_header
from tests.support.volatile_disk import VolatileDisk

from handsight.datasets import Curator, GraspDataset, GraspRepository, Selection, SessionWriter, create_branch, verify

CUTS = int(os.environ.get("HANDSIGHT_POWER_CUTS", "24"))
ACTS = 6
"""Things done to one dataset; looking at a cut takes longer the more there is."""
CUT_SHARE = 0.3
"""Share of the moments, of which a commit has a handful, at which the power is cut."""


@dataclass
class Acknowledged:
    """What the writer was told is stored, and what it was about to store."""

    attempts: int = 0
    pending: int = 0
    excluded: int = 0
    pending_excluded: int = 0
    releases: set[str] = field(default_factory=set)
    branches: set[str] = field(default_factory=lambda: {"main"})


@pytest.mark.timeout(3600)
def test_a_power_cut_at_any_moment_loses_nothing_acknowledged(tmp_path: Path) -> None:
    """HANDSIGHT_POWER_CUTS sets how often the power is cut."""
    rng, cuts = np.random.default_rng(CUTS), 0
    while cuts < CUTS:
        cuts += cut_while_writing(tmp_path, rng)


def cut_while_writing(folder: Path, rng: np.random.Generator) -> int:
    """Write to a new dataset, and look at what each of some power cuts would have left; returns how many there were."""
    path = folder / f"grasps-{rng.integers(10**9)}"
    repository, told, cuts = GraspRepository.create(path), Acknowledged(), 0
    disk = VolatileDisk(path)

    def maybe_cut() -> None:
        nonlocal cuts
        if rng.random() < CUT_SHARE:
            cuts += 1
            disk.cut(folder / "after", rng)
            check(folder / "after", told)

    with pytest.MonkeyPatch.context() as monkeypatch:
        disk.follow(monkeypatch, at_sync=maybe_cut)
        writer = SessionWriter.begin(repository, make_header())
        for _ in range(ACTS):
            act(repository, writer, told, rng)
            maybe_cut()
    return cuts


def act(repository: GraspRepository, writer: SessionWriter, told: Acknowledged, rng: np.random.Generator) -> None:
    """Do one of the things that a dataset acknowledges."""
    what = rng.choice(["record", "exclude", "release", "branch"], p=[0.6, 0.2, 0.1, 0.1])
    if what == "record" or not told.attempts:
        for _ in range(int(rng.integers(1, 4))):
            writer.append(make_attempt(writer.header, writer.next_number))
        told.pending = writer.next_number
        writer.commit()
        told.attempts = told.pending
    elif what == "exclude":
        rows = GraspDataset(repository, ref="main").attempts
        kept = rows.index[~rows["excluded"]]
        if len(kept):
            told.pending_excluded = told.excluded + 1
            chosen = Selection(ids=(str(kept[0]),))
            Curator(repository, author="test").exclude(chosen, reason="blurred")
            told.excluded = told.pending_excluded
    elif what == "release":
        name = f"v{len(told.releases)}"
        repository.release(name)
        told.releases.add(name)
    else:
        name = f"b{len(told.branches)}"
        create_branch(repository, name)
        told.branches.add(name)


def check(path: Path, told: Acknowledged) -> None:
    """What is there after the cut is whole, and holds at least what was acknowledged."""
    repository = GraspRepository.open(path)
    dataset = GraspDataset(repository, ref="main")
    assert told.attempts <= len(dataset.attempts) <= max(told.attempts, told.pending)
    assert told.excluded <= int(dataset.attempts["excluded"].sum()) <= max(told.excluded, told.pending_excluded)
    assert verify(dataset).ok
    assert told.releases <= set(repository.releases())
    assert told.branches <= set(repository.branches())
    for name in (*repository.releases(), *repository.branches()):
        assert len(GraspDataset(repository, ref=name).attempts) <= len(dataset.attempts)
