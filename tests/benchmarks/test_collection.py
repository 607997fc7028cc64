"""The collection benchmark at its smallest: what it reports is there, adds up and comes from what ran."""

from __future__ import annotations

import json
import mmap
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks import Figure
from benchmarks.__main__ import report
from benchmarks._watched_station import PhaseTimes, WatchedStationFactory
from benchmarks.collection import PHASES, SEED, STATION, Size, measure
from benchmarks.floors.processes import pinned, proportional_bytes
from benchmarks.peers.kuka import NAME, Peer, environment, kuka_peer
from handsight.collection.attempt import attempt_seed, run_attempt
from handsight.collection.policy import UniformPolicy
from handsight.collection.sim.station import SimStation, SimStationFactory
from handsight.datasets.records import GraspAttempt

CONTRACT = {"name", "ours", "unit", "floor", "ratio", "peers", "n"}
TINY = Size(commits=1, commit_every=3, warm_up=1)
KUKA = Peer(per_hour={NAME: 1000.0}, what="The peer was not run.")


@pytest.fixture(scope="module")
def figures() -> dict[str, Figure]:
    return {figure.name: figure for figure in measure(TINY, KUKA)}


def attempted(station: SimStation) -> GraspAttempt:
    try:
        return run_attempt(station, UniformPolicy(), 0, attempt_seed(SEED, 0))
    finally:
        station.close()


def test_the_headline_keeps_the_contract(figures: dict[str, Figure]) -> None:
    printed = json.loads(json.dumps(report("collection", list(figures.values()))))
    assert set(printed) >= CONTRACT
    assert printed["unit"] == "attempts/h"
    assert printed["peers"] == {"paper": pytest.approx(216, abs=0.5), NAME: 1000.0}
    assert printed["n"] == 3
    assert KUKA.what in printed["what"]


def test_every_figure_is_there(figures: dict[str, Figure]) -> None:
    phases = [f"of it, {phase}" for phase in (*PHASES, "store", "the rest")]
    expected = ["attempts on one core", "time for an attempt", "memory of a worker", "two cores against one", *phases]
    if len(os.sched_getaffinity(0)) == 1:
        expected.remove("two cores against one")
    assert list(figures) == expected


def test_the_floor_is_part_of_what_it_is_the_floor_of(figures: dict[str, Figure]) -> None:
    whole, rate = figures["time for an attempt"], figures["attempts on one core"]
    assert whole.floor is not None
    assert rate.floor == pytest.approx(3.6e6 / whole.floor)
    phases = [figures[f"of it, {phase}"] for phase in PHASES]
    floors = [figure.floor for figure in phases if figure.floor is not None]
    assert len(floors) == len(PHASES)
    assert all(0 < floor <= figure.ours for floor, figure in zip(floors, phases, strict=True))
    assert sum(floors) == pytest.approx(whole.floor)


def test_phases_add_up_to_the_attempt(figures: dict[str, Figure]) -> None:
    parts = [figure.ours for name, figure in figures.items() if name.startswith("of it, ")]
    assert sum(parts) == pytest.approx(figures["time for an attempt"].ours)


def test_a_watched_station_does_the_same_and_counts_every_step(tmp_path: Path) -> None:
    notes = tmp_path / "times.json"
    watched = attempted(WatchedStationFactory(config=STATION, notes=notes)())
    plain = attempted(SimStationFactory(config=STATION)())
    assert watched.overhead is not None
    assert plain.overhead is not None
    np.testing.assert_array_equal(watched.overhead.rgb, plain.overhead.rgb)
    np.testing.assert_array_equal(watched.overhead.depth, plain.overhead.depth)
    np.testing.assert_array_equal(watched.pose_base_tool_grasp, plain.pose_base_tool_grasp)
    np.testing.assert_array_equal(watched.phase_s, plain.phase_s)
    assert (watched.outcome, watched.gripper) == (plain.outcome, plain.gripper)
    times = PhaseTimes.read(notes)
    assert times.attempts == 1
    assert times.steps == round(float(watched.phase_s.sum()) * STATION.physics_hz)


def test_the_window_holds_as_many_commits_for_any_number_of_workers() -> None:
    size = Size(commits=2, commit_every=4, warm_up=3)
    for workers in (1, 2, 5):
        taken = range(size.warm_up, size.attempts(workers))
        assert sum(held % size.commit_every == 0 for held in taken) == 2 * workers


def test_pinning_reaches_children_and_ends() -> None:
    before = os.sched_getaffinity(0)
    core = max(before)
    ask = [sys.executable, "-P", "-c", "import os; print(*os.sched_getaffinity(0))"]
    with pinned({core}):
        assert os.sched_getaffinity(0) == {core}
        assert subprocess.run(ask, check=True, capture_output=True, text=True).stdout.split() == [str(core)]
    assert os.sched_getaffinity(0) == before


def test_a_process_counts_the_memory_it_touches() -> None:
    # Pages of its own: bytes may come from memory that earlier tests touched and the allocator kept.
    with mmap.mmap(-1, 64_000_000) as block:
        before = proportional_bytes(os.getpid())
        for _ in range(64):
            block.write(b"\1" * 1_000_000)
        assert proportional_bytes(os.getpid()) - before == pytest.approx(64_000_000, rel=0.1)


def test_a_peer_that_cannot_be_installed_is_left_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "cache").write_text("not a folder")
    monkeypatch.setenv("HANDSIGHT_CACHE", str(tmp_path / "cache"))
    peer = kuka_peer(1, core=min(os.sched_getaffinity(0)))
    assert peer.per_hour == {}
    assert peer.what.startswith(f"{NAME} is left out: ")
    assert str(tmp_path) in peer.what


def test_an_environment_is_made_once_and_again_for_other_requirements(tmp_path: Path) -> None:
    folder = tmp_path / "peer"
    folder.mkdir()
    stamp = folder / "requirements.txt"
    stamp.write_text("one==1\n")
    assert environment(folder, ["one==1"]) == folder / "bin" / "python"
    assert not (folder / "bin").exists()
    with pytest.raises(subprocess.CalledProcessError, match="pip"):
        environment(folder, ["./no-such-folder"])
    assert (folder / "bin").exists()
    assert not stamp.exists()
