"""Versions of one dataset that grow by turns."""

from __future__ import annotations

from tests.support.factories import make_attempt, make_header

from handsight.datasets import GraspDataset, GraspRepository, Outcome, SessionWriter

HEADER = make_header()


def opened(repository: GraspRepository, ref: str = "main") -> GraspDataset:
    return GraspDataset.open(f"{repository.path}@{ref}")


def numbers(ids: tuple[str, ...]) -> list[int]:
    return [int(identity.rpartition("-")[2]) for identity in ids]


def grow(repository: GraspRepository, to: int, branch: str = "main") -> str:
    """Go on with the session until it has that many attempts, held and empty by turns."""
    held = bool(opened(repository, branch).sessions)
    with (SessionWriter.resume if held else SessionWriter.begin)(repository, HEADER, branch) as writer:
        while writer.next_number < to:
            outcome = Outcome.EMPTY if writer.next_number % 2 else Outcome.HELD
            writer.append(make_attempt(HEADER, writer.next_number, outcome=outcome))
    return repository.resolve(branch)
