"""A day of an unattended rig by the emulator's clock, with faults at random; resumed by the same command.

``python tests/support/rig_day.py FOLDER [--hours 24] [--generation cb3] [--speed 40] [--faults-per-hour 4] [--seed 1]``
runs it, ``--report`` says what there is so far. Three processes: the emulated rig, which lets its own faults happen;
one that collects; and this one, which kills either or lets the disk run full, and after a pause does what a person
does. A line of ``attempts.jsonl`` is an attempt that was told of.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import signal
import subprocess
import sys
import time
import types
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

if "tests" not in sys.modules:
    # The root stays off the import path: its folder ``datasets`` shadows a well-known package.
    sys.modules["tests"] = types.ModuleType("tests")
    sys.modules["tests"].__path__ = [str(Path(__file__).resolve().parents[1])]

import numpy as np
from tests.support.emulated_rig import CONTROL_PORT, RunningRig, free_address
from tests.support.rig_day_report import report
from tests.support.rig_files import station_factory
from tests.support.rig_person import POWER_CYCLE, repair
from tests.support.watched_rig import WatchedFactory, holds

from handsight.collection.collector import CollectSettings
from handsight.collection.errors import CollectionError
from handsight.collection.ur10.logs import append_line
from handsight.collection.ur10.session import collect_on_rig
from handsight.datasets import GraspRepository
from handsight.datasets.atomic import write_text
from handsight.datasets.errors import DatasetError
from handsight.datasets.records import GraspAttempt

LOOK_S = 0.5
"""Wall time between two looks at the rig."""
HUNG_S = 240.0
"""A heartbeat of this age, of wall time, belongs to a process that hangs."""
MACHINE_FAULTS = ("kill-collector", "kill-client", "kill-emulator", "disk-full", "camera-unplugged")
MACHINE_SHARE = 0.25
"""What happens to machines, as a share of what happens to the rig."""
STATE, PROGRAM = "day.json", "power_cycle.py"


class Day:
    """One run, from wherever it was left."""

    def __init__(self, options: argparse.Namespace) -> None:
        """Go on in a folder, or begin there."""
        self.folder: Path = options.folder
        self.folder.mkdir(parents=True, exist_ok=True)
        self._options = options
        (self.folder / PROGRAM).write_text(POWER_CYCLE, encoding="utf-8")
        state = self.folder / STATE
        if not state.exists():
            begun = {"robot": free_address(), "camera": free_address(), "generation": options.generation}
            write_text(state, json.dumps(begun))
        self.state: dict[str, str] = json.loads(state.read_text(encoding="utf-8"))
        self.life = len(list(self.folder.glob("life-*.json")))
        self.before_s = sum(one["clock_s"] for one in lives(self.folder))
        self._rng = np.random.default_rng([options.seed, self.life, 24])

    def run(self) -> None:
        """Until so many hours of the robot's clock are over."""
        while self.before_s < 3600 * self._options.hours:
            with self._emulated() as rig:
                self._live(rig)
            self.before_s = sum(one["clock_s"] for one in lives(self.folder))
            self.life += 1

    @contextmanager
    def _emulated(self) -> Iterator[RunningRig]:
        options, robot, camera = self._options, self.state["robot"], self.state["camera"]
        command = [sys.executable, "-m", "handsight.collection.ur10.emulator", "--robot", robot, "--camera", camera]
        command += ["--generation", self.state["generation"], "--control", str(CONTROL_PORT)]
        command += ["--objects", "household-train", "--speed", str(options.speed), "--depth-noise", "0.08"]
        command += ["--faults-per-hour", str(options.faults_per_hour), "--seed", str(options.seed + 1000 * self.life)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            try:
                assert process.stdout is not None
                if not process.stdout.readline():
                    raise RuntimeError(f"the emulator ended with status {process.wait()}")
                yield RunningRig(robot, camera, self.state["generation"], process)
            finally:
                process.kill()

    def _live(self, rig: RunningRig) -> None:
        """One life of the emulator: collect, let things go wrong, repair."""
        due_s = self._next_s(0.0)
        with self._collecting() as collector:
            while (status := self._look(rig)) is not None:
                if self.before_s + status["clock_s"] >= 3600 * self._options.hours:
                    return
                if collector.poll() is not None:
                    self._ended(rig, collector)
                    collector = self._start()
                elif self._hangs():
                    self._note("hung")
                    collector.kill()
                if status["clock_s"] > due_s:
                    due_s = self._next_s(status["clock_s"])
                    self._harm(rig, collector)
                time.sleep(LOOK_S)

    @contextmanager
    def _collecting(self) -> Iterator[subprocess.Popen[str]]:
        self._collector = self._start()
        try:
            yield self._collector
        finally:
            self._collector.send_signal(signal.SIGINT)
            with suppress(subprocess.TimeoutExpired):
                self._collector.wait(60)
            self._collector.kill()
            self._collector.wait()

    def _start(self) -> subprocess.Popen[str]:
        # The heartbeat of the one before says nothing about this one.
        (self.folder / "heartbeat.json").unlink(missing_ok=True)
        self._started_s = time.monotonic()
        command = [sys.executable, __file__, str(self.folder), "--collect"]
        with (self.folder / "collector.log").open("ab") as log:
            self._collector = subprocess.Popen(
                [*command, "--speed", str(self._options.speed), "--life", str(self.life)],
                stdout=subprocess.PIPE,
                stderr=log,
                text=True,
            )
        return self._collector

    def _look(self, rig: RunningRig) -> dict[str, Any] | None:
        """What the rig does, kept; None once it is gone."""
        try:
            status = rig.do("status")
        except (OSError, ValueError):
            return None
        kept = {name: status[name] for name in ("clock_s", "fired", "travelled_m", "protective_stops")}
        write_text(self.folder / f"life-{self.life:04d}.json", json.dumps(kept))
        return status

    def _ended(self, rig: RunningRig, collector: subprocess.Popen[str]) -> None:
        """The collector is gone: by a pause, after which a person comes, or killed."""
        assert collector.stdout is not None
        reason = collector.stdout.read().strip()
        self._note("collector ended", status=collector.returncode, paused=reason)
        if collector.returncode >= 0:
            repair(rig)

    def _hangs(self) -> bool:
        heartbeat = self.folder / "heartbeat.json"
        if not heartbeat.exists():
            return time.monotonic() - self._started_s > HUNG_S
        return time.time() - heartbeat.stat().st_mtime > HUNG_S

    def _next_s(self, clock_s: float) -> float:
        per_hour = MACHINE_SHARE * self._options.faults_per_hour
        return clock_s + float(self._rng.exponential(3600.0 / per_hour)) if per_hour else float("inf")

    def _harm(self, rig: RunningRig, collector: subprocess.Popen[str]) -> None:
        fault = str(self._rng.choice(MACHINE_FAULTS))
        self._note("harm", fault=fault)
        if fault == "kill-emulator":
            rig.process.kill()
        elif fault == "kill-collector":
            collector.kill()
        elif fault == "disk-full":
            resource.prlimit(collector.pid, resource.RLIMIT_FSIZE, (0, resource.RLIM_INFINITY))
        elif fault == "kill-client":
            clients = _children(collector.pid)
            if clients:
                with suppress(ProcessLookupError):
                    os.kill(clients[int(self._rng.integers(len(clients)))], signal.SIGKILL)
        else:
            with suppress(OSError, ValueError):
                rig.do("fault", fault=f"{fault}@look")

    def _note(self, what: str, **values: Any) -> None:
        append_line(self.folder / "day.jsonl", {"life": self.life, "what": what, **values})


def lives(folder: Path) -> list[dict[str, Any]]:
    """What the emulators of a run last said."""
    return [json.loads(path.read_text(encoding="utf-8")) for path in sorted(folder.glob("life-*.json"))]


def _children(pid: int) -> list[int]:
    """Clients of a collector: its spawned processes, without the one that tracks resources."""
    text = Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="utf-8")
    found = [int(word) for word in text.split()]
    return [one for one in found if b"spawn_main" in Path(f"/proc/{one}/cmdline").read_bytes()]


def collect(options: argparse.Namespace) -> int:
    """The process that collects; 1 after a pause, as the command has it."""
    folder: Path = options.folder
    state = json.loads((folder / STATE).read_text(encoding="utf-8"))
    rig = RunningRig(state["robot"], state["camera"], state["generation"], None)  # type: ignore[arg-type]

    def told(attempt: GraspAttempt, _: int) -> None:
        line: dict[str, Any] = {"number": attempt.number, "outcome": attempt.outcome.name, "held": attempt.truth_held}
        with suppress(OSError, ValueError):
            line["held_later"] = holds(rig)
        append_line(folder / "attempts.jsonl", {**line, "failure": attempt.failure[:300], "life": options.life})

    settings = CollectSettings(attempts=1_000_000)
    try:
        factory = _factory(folder, rig, folder / PROGRAM, options.speed)
        repository = GraspRepository.open_or_create(folder / "grasps")
        ended = collect_on_rig(repository, factory, settings, resume=True, on_attempt=told).paused
    except (CollectionError, DatasetError, OSError) as error:
        ended = f"not begun: {type(error).__name__}: {error}"
    sys.stdout.write(ended)  # The disk may be full.
    return 1


def _factory(folder: Path, rig: RunningRig, program: Path, speed: float) -> WatchedFactory:
    found = station_factory(folder, rig, power_cycle=(sys.executable, str(program), rig.robot, str(CONTROL_PORT)))
    # Caps count by the wall's clock, by which everything comes so many times faster here.
    recovery = replace(
        found.rig.recovery, protective_stops_per_10_min=round(3 * speed), recoveries_per_hour=round(20 * speed)
    )
    guards = replace(found.rig.guards, empty_looks=3)
    config = replace(found.rig, recovery=recovery, guards=guards)
    return WatchedFactory(rig=config, calibration=found.calibration, watched=rig)


def main() -> int:
    """Run, go on, or report."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--hours", type=float, default=24.0)
    parser.add_argument("--generation", default="cb3")
    parser.add_argument("--speed", type=float, default=40.0)
    parser.add_argument("--faults-per-hour", type=float, default=4.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--report", action="store_true")
    parser.add_argument("--collect", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--life", type=int, default=0, help=argparse.SUPPRESS)
    options = parser.parse_args()
    # Shells have what they start in the background ignore it, and what that starts too.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    if options.collect:
        return collect(options)
    if not options.report:
        Day(options).run()
    found = report(options.folder, lives(options.folder))
    sys.stdout.write(json.dumps(found, indent=2) + "\n")
    return int(bool(found["wrong"]))


if __name__ == "__main__":
    sys.exit(main())
