"""Attempts with pictures: written, committed, read back."""

from __future__ import annotations

import hashlib
import os
import statistics
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks import Figure, duration_s, median_rate, median_s
from benchmarks.floors.bare_commits import BareRepository, last_commit
from benchmarks.floors.frames import png, rendered_attempts
from benchmarks.floors.million import header_of
from benchmarks.floors.processes import pinned
from handsight.datasets import GraspDataset, GraspRepository, SessionHeader, SessionWriter
from handsight.datasets.format.arrays import array_at
from handsight.datasets.format.frames import frame_paths
from handsight.datasets.integrity.verify import verify
from handsight.datasets.records import GraspAttempt

_SEED = 0

ATTEMPTS = 48

_BARE_FRAMES = 8

_ROUNDS = 4
"""Times that the attempts are repeated where they are verified, so that opening the dataset does not count for much."""


def recording_figures(folder: Path) -> list[Figure]:
    """Writing whole attempts: rate, size, commit, and reading them back to verify them."""
    header = header_of(_SEED)
    attempts = rendered_attempts(header, ATTEMPTS, np.random.default_rng(_SEED))
    pngs = [_png_pair_bytes(attempt) for attempt in attempts]
    raw = sum(_raw_bytes(attempt) for attempt in attempts)
    written = iter(range(1_000))

    def record() -> None:
        _record(folder / f"grasps-{next(written)}", header, attempts)

    write_rate = median_rate(record, ATTEMPTS, runs=3)
    png_rate = median_rate(lambda: [_png_pair_bytes(attempt) for attempt in attempts], ATTEMPTS, runs=3)
    dataset = GraspDataset.open(str(folder / "grasps-0"))
    return [
        Figure(
            name="attempts written",
            ours=write_rate,
            unit="attempts/s",
            peers={"PNG pairs, encoding alone": png_rate},
            n=ATTEMPTS,
            what="Attempts with two 640x480 RGB-D pictures appended, checked, digested and committed, and synced.",
        ),
        Figure(
            name="lossless size",
            ours=dataset.info().bytes / ATTEMPTS,
            unit="bytes/attempt",
            floor=float(np.mean(pngs)),
            peers={"raw": raw / ATTEMPTS},
            n=ATTEMPTS,
            what="Bytes on disk for each attempt, history and all; the floor is its pictures as PNG pairs.",
        ),
        *_commits(folder / "commits", header, attempts),
        *_verification(folder / "verification", header, attempts),
    ]


def _record(path: Path, header: SessionHeader, attempts: list[GraspAttempt], every: int = 16) -> None:
    writer = SessionWriter.begin(GraspRepository.create(path), header)
    for attempt in attempts:
        writer.append(attempt)
        if writer.next_number % every == 0:
            writer.commit()
    writer.seal()


def _commits(path: Path, header: SessionHeader, attempts: list[GraspAttempt]) -> list[Figure]:
    """Attempts appended and committed one by one to a session that grows, durably."""
    repository, bare = GraspRepository.create(path), BareRepository(path.with_name("bare"))
    writer = SessionWriter.begin(repository, header)
    appends_s, commits_s, bare_s = [], [], []
    for attempt in attempts:
        appends_s.append(duration_s(partial(writer.append, attempt)))
        commits_s.append(duration_s(writer.commit))
        bare_s.append(bare.commit_s(last_commit(repository, writer.session, attempt.number)))
    n = len(attempts) - 1
    return [
        Figure(
            name="append",
            ours=1e3 * statistics.median(appends_s[1:]),
            unit="ms",
            n=n,
            what="One attempt with two 640x480 RGB-D pictures checked, digested and compressed.",
        ),
        Figure(
            name="commit",
            ours=1e3 * statistics.median(commits_s[1:]),
            floor=1e3 * statistics.median(bare_s[1:]),
            unit="ms",
            n=n,
            what=(
                "One commit of one such attempt to a session that holds some, synced; the floor is to hand Icechunk "
                "the same files, ready made, with the same syncs."
            ),
        ),
    ]


def _verification(path: Path, header: SessionHeader, attempts: list[GraspAttempt]) -> list[Figure]:
    """Reading every byte back and comparing it with the digests."""
    many = [replace(attempt, number=number) for number, attempt in enumerate(_ROUNDS * attempts)]
    _record(path, header, many)
    dataset = GraspDataset.open(str(path))
    megabytes = sum(map(_raw_bytes, many)) / 1e6

    def bare() -> None:
        root = dataset.root
        for session in dataset.sessions:
            for path in frame_paths():
                array = array_at(root, f"sessions/{session.ulid}/{path}")
                for start in range(0, session.attempts, _BARE_FRAMES):
                    hashlib.sha256(np.asarray(array[start : start + _BARE_FRAMES]).data)

    def figure(name: str, where: str) -> Figure:
        return Figure(
            name=name,
            ours=megabytes / median_s(lambda: verify(dataset), runs=3),
            floor=megabytes / median_s(bare, runs=3),
            unit="MB/s",
            n=len(many),
            what=(
                f"Decoded bytes of pictures read back, checked and compared with the digests, on {where}; the floor is "
                "to read them with zarr as it comes and to hash them."
            ),
        )

    cores = sorted(os.sched_getaffinity(0))
    with pinned(cores[:1]):
        one = figure("verify, one core", "one core")
    return [one, figure("verify", f"{len(cores)} cores")]


def _raw_bytes(attempt: GraspAttempt) -> int:
    return sum(view.rgb.nbytes + view.depth.nbytes for view in (attempt.overhead, attempt.pregrasp) if view)


def _png_pair_bytes(attempt: GraspAttempt) -> int:
    views = [view for view in (attempt.overhead, attempt.pregrasp) if view]
    return sum(len(png(view.rgb)) + len(png(view.depth)) for view in views)
