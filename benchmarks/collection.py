"""Collecting in simulation: attempts per hour, the floor below them, memory, a second core, phases."""

from __future__ import annotations

import multiprocessing
import os
import tempfile
import time
from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path

from benchmarks import Figure
from benchmarks._watched_station import PhaseTimes, WatchedStationFactory
from benchmarks.floors.processes import pinned, proportional_bytes
from benchmarks.peers.kuka import Peer, kuka_peer
from handsight.collection.collector import CollectSettings, collect
from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.station import SimStationFactory
from handsight.datasets import GraspRepository
from handsight.datasets.records import GraspAttempt

SEED = 0
EPISODES = 32
PAPER_PER_HOUR = 30_000 / 139
"""30,000 attempts in 139 hours, "in a single simulation running on a single desktop computer" (section V-B)."""
STATION = SimConfig(objects="household-train")
PHASES = {
    "settle": "An empty world, table, arm and five objects, which fall and come to rest",
    "look": "A 640x480 picture with depth",
    "reach": "The move from the overhead to the pre-grasp pose",
    "descend": "The way down until contact or table",
    "close": "The jaws close until they stall or meet",
    "lift": "The lift to 0.25 m",
}
"""Phases as the worker runs them, and what happens in them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Size:
    """How much each worker collects."""

    commits: int = 4
    """Commits that are timed, with the attempts they store."""
    commit_every: int = CollectSettings(attempts=1).commit_every
    warm_up: int = 8
    """Attempts before the clock starts, fewer than ``commit_every``: by then every worker has begun."""

    def attempts(self, workers: int) -> int:
        """Length of the session of some workers."""
        return self.warm_up + workers * self.commits * self.commit_every


@dataclass(slots=True)
class Window:
    """A span between two attempts of a session; it is told of each attempt as the writer takes it."""

    first: int
    """Length of the session when the clock starts."""
    last: int
    """And when it stops."""
    wall_s: float = 0.0
    writer_s: float = 0.0
    """Processor time of this process, the writer's, meanwhile [s]."""
    worker_bytes: list[int] = field(default_factory=list)
    """Memory of each worker at the end."""

    def __call__(self, attempt: GraspAttempt, held: int) -> None:
        """Start or stop the clock when the session holds as many attempts."""
        if held == self.first:
            self.wall_s, self.writer_s = -time.perf_counter(), -time.process_time()
        elif held == self.last:
            self.wall_s += time.perf_counter()
            self.writer_s += time.process_time()
            workers = (child.pid for child in multiprocessing.active_children())
            self.worker_bytes = [proportional_bytes(pid) for pid in workers if pid is not None]

    @property
    def attempts(self) -> int:
        """Attempts between start and stop."""
        return self.last - self.first

    @property
    def attempt_s(self) -> float:
        """Time for an attempt [s]."""
        return self.wall_s / self.attempts

    @property
    def per_hour(self) -> float:
        """Attempts in an hour."""
        return 3600 / self.attempt_s


def run() -> list[Figure]:
    """All figures of simulated collection."""
    return measure(Size(), kuka_peer(EPISODES, core=min(os.sched_getaffinity(0))))


def measure(size: Size, kuka: Peer) -> list[Figure]:
    """Collect on one core, once more to see where the time goes, and on two cores where there are two."""
    cores = sorted(os.sched_getaffinity(0))
    factory = SimStationFactory(config=STATION)
    with tempfile.TemporaryDirectory(prefix="handsight-bench-") as name:
        folder = Path(name)
        one = collected(folder / "one", factory, size, cores=cores[:1])
        watched = WatchedStationFactory(config=STATION, notes=folder / "times.json")
        seen = collected(folder / "watched", watched, size, cores=cores[:1])
        times = PhaseTimes.read(watched.notes)
        figures = [_rate(one, times, kuka), _over_the_floor(seen, times), _memory(one)]
        if len(cores) > 1:
            figures.append(_second_core(one, collected(folder / "two", factory, size, cores=cores[:2])))
    return [*figures, *_phases(seen, times)]


def collected(path: Path, factory: SimStationFactory, size: Size, *, cores: Collection[int]) -> Window:
    """Collect into a new dataset with a worker for each core, worker and writer on these cores and no other.

    The window opens and closes equally long after a commit, so that it holds as many commits as it must pay for.
    """
    attempts = size.attempts(len(cores))
    settings = CollectSettings(attempts=attempts, seed=SEED, workers=len(cores), commit_every=size.commit_every)
    window = Window(first=size.warm_up, last=attempts)
    with pinned(cores):
        collect(GraspRepository.create(path), factory, settings, on_attempt=window)
    return window


def _rate(one: Window, times: PhaseTimes, kuka: Peer) -> Figure:
    return Figure(
        name="attempts on one core",
        ours=one.per_hour,
        unit="attempts/h",
        floor=3600 / _floor_s(times),
        peers={"paper": PAPER_PER_HOUR} | kuka.per_hour,
        n=one.attempts,
        what=(
            f"Simulated attempts on {STATION.objects} with the whole arm and 640x480 RGB-D, stored without loss and "
            "committed, worker and writer on one core. The floor is Bullet's share: the physics steps of these "
            f"attempts and one picture of each. The paper took 139 h for 30,000. {kuka.what}"
        ),
    )


def _over_the_floor(seen: Window, times: PhaseTimes) -> Figure:
    return Figure(
        name="time for an attempt",
        ours=1e3 * seen.attempt_s,
        unit="ms",
        floor=1e3 * _floor_s(times),
        n=seen.attempts,
        what=(
            "The same attempts with Bullet's calls timed, writer included; the floor is the processor time inside "
            f"stepSimulation ({times.steps / times.attempts:.0f} steps an attempt) and inside getCameraImage."
        ),
    )


def _memory(one: Window) -> Figure:
    return Figure(
        name="memory of a worker",
        ours=max(one.worker_bytes) / 1e6,
        unit="MB",
        n=one.last,
        what=f"Proportional set size (PSS) of the worker after {one.last} attempts.",
    )


def _second_core(one: Window, two: Window) -> Figure:
    return Figure(
        name="two cores against one",
        ours=two.per_hour / one.per_hour,
        unit="times",
        n=two.attempts,
        what=(
            f"Attempts per hour of two workers and the writer on two cores ({two.per_hour:,.0f}) over those of one "
            "worker and the writer on one."
        ),
    )


def _phases(seen: Window, times: PhaseTimes) -> list[Figure]:
    """What the time for an attempt is made of; the figures add up to it."""
    figures = [
        Figure(
            name=f"of it, {phase}",
            ours=1e3 * times.phase_s[phase] / times.attempts,
            unit="ms",
            floor=1e3 * times.bullet_s[phase] / times.attempts,
            n=times.attempts,
            what=f"{what}; the floor is Bullet's share of it.",
        )
        for phase, what in PHASES.items()
    ]
    storing_ms = 1e3 * seen.writer_s / seen.attempts
    rest_ms = 1e3 * seen.attempt_s - storing_ms - sum(figure.ours for figure in figures)
    return [
        *figures,
        Figure(
            name="of it, store",
            ours=storing_ms,
            unit="ms",
            n=seen.attempts,
            what="The writer's processor time: take, check, digest, compress, commit, sync.",
        ),
        Figure(
            name="of it, the rest",
            ours=rest_ms,
            unit="ms",
            n=seen.attempts,
            what="What is left: handing the attempt over to the writer, and waiting for the disk or for the core.",
        ),
    ]


def _floor_s(times: PhaseTimes) -> float:
    return sum(times.bullet_s.values()) / times.attempts
