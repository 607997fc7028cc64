"""Every fault of the emulated rig in every phase of an attempt, and what becomes of it.

As a program it runs the whole matrix, appends a line of JSON for each case to a file, leaves out what the file has
already, and prints the table of it: ``python tests/support/rig_faults.py --out cases.jsonl [--generation cb3]
[--faults a,b] [--phases c,d]``, ``--table`` for the table alone. A few cases are tests.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
import types
from collections.abc import Callable, Iterable, Sequence
from contextlib import AbstractContextManager, suppress
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

if "tests" not in sys.modules:
    # The root stays off the import path: its folder ``datasets`` shadows a well-known package.
    sys.modules["tests"] = types.ModuleType("tests")
    sys.modules["tests"].__path__ = [str(Path(__file__).resolve().parents[1])]

from tests.support.alarms import Alarms, listening
from tests.support.emulated_rig import CONTROL_PORT, RunningRig, running_rig
from tests.support.local_faults import LOCAL, let_files_grow
from tests.support.rig_faults_table import table
from tests.support.rig_files import station_factory
from tests.support.rig_person import POWER_CYCLE, repair, stayed_inside
from tests.support.watched_rig import AimedPolicy, WatchedFactory, WatchedStation

from handsight.collection.collector import CollectSettings
from handsight.collection.errors import CollectionError
from handsight.collection.ur10.session import collect_on_rig
from handsight.datasets import GraspDataset, GraspRepository
from handsight.datasets.errors import DatasetError
from handsight.datasets.records import GraspAttempt

PHASES = ("look", "reach", "descend", "close", "lift", "shake", "release")
FAULTS = (
    "drop",
    "freeze:s=3",
    "kill-controller",
    "protective-stop",
    "emergency-stop",
    "system-emergency-stop",
    "safeguard-stop",
    "safety-fault",
    "safety-violation",
    "force-noise",
    "force-drift",
    # Both matter to a client that connects.
    "in-use+drop",
    "remote-off+drop",
    "gripper-fault",
    "gripper-fault:code=14",
    "gripper-silent:s=3",
    "gripper-silent",
    "gripper-reset",
    "slip",
    "joint-hot",
    "camera-dropout",
    "camera-frozen",
    "camera-stale",
    "camera-black",
    "camera-no-depth",
    "camera-frozen:cure=reset",
    "camera-black:cure=power-cycle",
    "camera-unplugged",
    "disk-full",
    "kill-arm",
    "kill-camera",
)
HELD_PHASES = ("lift", "shake")
"""Phases in which something may slip; what is let go does not."""
STATION_PHASE = {"release": "settle"}
"""What the station calls a phase, where that is another word."""
MOST_ATTEMPTS = 12
"""Of a case: some wait for a grasp that holds."""
STAND_S = 10.0


@dataclass(slots=True, kw_only=True)
class Verdict:
    """What became of one fault."""

    fault: str
    phase: str
    fired: int = 0
    outcomes: list[str] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)
    paused: str = ""
    stopped: str = ""
    """The error that ended the session otherwise."""
    seconds: float = 0.0
    wrong: list[str] = field(default_factory=list)
    """What must not have happened."""

    @property
    def ending(self) -> str:
        """How the rig got over it."""
        if not self.fired:
            return "did not happen"
        if self.paused or self.stopped:
            return "paused" if self.paused else "stopped"
        return "recovered" if self.failures else "unharmed"


class _EnoughSeen(KeyboardInterrupt):
    """The fault has happened, and an attempt came after it: the operator ends the session."""


class Matrix:
    """One emulated rig that is driven through cases."""

    def __init__(self, rig: RunningRig, folder: Path, alarms: Alarms) -> None:
        """Collect into ``folder``; ``alarms`` hears of pauses."""
        self.rig = rig
        program = folder / "power_cycle.py"
        program.write_text(POWER_CYCLE, encoding="utf-8")
        found = station_factory(folder, rig, power_cycle=(sys.executable, str(program), rig.robot, str(CONTROL_PORT)))
        alarm = replace(found.rig.alarm, webhook=alarms.url)
        self.alarms = alarms
        self.factory = WatchedFactory(
            rig=replace(found.rig, alarm=alarm), calibration=found.calibration, watched=rig, at_phase=self._at_phase
        )
        self.dataset = folder / "grasps"
        self.told = 0
        """Attempts that were told of."""
        self._left: list[Verdict] = []
        self._due: tuple[str, str] | None = None
        self._begun_s = 0.0
        self._happened = self._before = self._since = 0

    def run(self, fault: str, phase: str) -> Verdict:
        """Let one fault happen in one phase of the next attempts."""
        found: list[Verdict] = []
        self.run_all(fault, [phase], found.append)
        return found[0]

    def run_all(self, fault: str, phases: Sequence[str], done: Callable[[Verdict], None]) -> None:
        """Let a fault happen in one phase after the other, in one session unless it pauses; ``done`` hears of each."""
        self._left = [Verdict(fault=fault, phase=phase) for phase in phases]
        while self._left:
            self._begin()
            try:
                paused, stopped = self._collect(done), ""
            except (CollectionError, DatasetError) as error:
                paused, stopped = "", f"{type(error).__name__}: {error}"
            finally:
                self._due = None
                let_files_grow()
            if self._left:
                verdict = self._left[0]
                verdict.paused, verdict.stopped = paused, stopped
                self._finish(done)

    def _begin(self) -> None:
        """Repair what the case of before has left, and have the next one happen when its phase comes."""
        repair(self.rig)
        self._begun_s, self._happened, self._since = time.monotonic(), 0, 0
        self._before = len(self._status()["fired"])
        self._due = (self._left[0].fault, self._left[0].phase)

    @property
    def _fired(self) -> int:
        return self._happened + len(self._status()["fired"]) - self._before

    def _finish(self, done: Callable[[Verdict], None]) -> None:
        verdict = self._left.pop(0)
        verdict.fired = self._fired
        self._check_place(verdict)
        self._check_kept(verdict)
        if verdict.paused and not any(verdict.paused in text for text in self.alarms.heard):
            verdict.wrong.append("the alarm did not tell of the pause")
        verdict.seconds = round(time.monotonic() - self._begun_s, 1)
        done(verdict)

    def _status(self) -> dict[str, Any]:
        return self.rig.do("status")

    def _at_phase(self, station: WatchedStation, phase: str) -> None:
        """Let the fault that is due happen: in the attempt itself, and not on the way to its beginning."""
        if self._due is None or phase != STATION_PHASE.get(self._due[1], self._due[1]):
            return
        if phase == "settle" and not station.holding:
            return
        (fault, when), self._due = self._due, None
        if fault in LOCAL:
            self._happened += 1
            LOCAL[fault](station)
            return
        for one in fault.split("+"):
            armed = self.rig.do("fault", fault=f"{one}@{when}")
            if "error" in armed:
                raise AssertionError(armed["error"])

    def _collect(self, done: Callable[[Verdict], None]) -> str:
        """Collect until the rig pauses, and return why, or until all cases are through."""

        def told(attempt: GraspAttempt, _: int) -> None:
            self._take_in(attempt)
            if self._since > 1 or len(self._left[0].outcomes) >= MOST_ATTEMPTS:
                self._finish(done)
                if not self._left:
                    raise _EnoughSeen
                self._begin()

        most = self.told + MOST_ATTEMPTS * len(self._left)
        settings = CollectSettings(attempts=most, policy=AimedPolicy(self.rig))
        try:
            repository = GraspRepository.open_or_create(self.dataset)
            return collect_on_rig(repository, self.factory, settings, resume=True, on_attempt=told).paused
        except _EnoughSeen:
            return ""

    def _take_in(self, attempt: GraspAttempt) -> None:
        verdict = self._left[0]
        self.told += 1
        verdict.outcomes.append(attempt.outcome.name)
        if attempt.failure:
            verdict.failures.append(attempt.failure[:160])
        if attempt.labelled and attempt.truth_held != attempt.success:
            verdict.wrong.append(f"attempt {attempt.number} is {attempt.outcome.name}, held: {attempt.truth_held}")
        self._since += self._fired > 0

    def _check_place(self, verdict: Verdict) -> None:
        """Whatever was killed, the arm comes to a stand, and was never outside."""
        until = time.monotonic() + STAND_S
        while (status := self._status())["moving"] and time.monotonic() < until:
            time.sleep(0.05)
        if status["moving"]:
            verdict.wrong.append("the arm goes on moving")
        if not stayed_inside(self.factory.rig.workspace, status["travelled_m"]):
            verdict.wrong.append(f"the fingertips were between {status['travelled_m']}")

    def _check_kept(self, verdict: Verdict) -> None:
        kept = len(GraspDataset.open(str(self.dataset)).attempts) if self.told else 0
        if kept != self.told:
            verdict.wrong.append(f"{self.told} attempts were told of, {kept} are kept")


def cases(faults: Iterable[str], phases: Iterable[str]) -> list[tuple[str, str]]:
    """Every fault in every phase in which it can happen."""
    phases = list(phases)
    return [(fault, phase) for fault in faults for phase in phases if fault != "slip" or phase in HELD_PHASES]


def main() -> int:
    """Run what is missing of the matrix and print its table; 1 if anything went wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--generation", default="e-series")
    parser.add_argument("--faults", default=",".join(FAULTS))
    parser.add_argument("--phases", default=",".join(PHASES))
    parser.add_argument("--speed", default="16")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--table", action="store_true")
    options = parser.parse_args()
    lines = _lines(options.out)
    done = {(line["generation"], line["fault"], line["phase"]) for line in lines}
    for fault in () if options.table else options.faults.split(","):
        left = [
            phase for _, phase in cases([fault], options.phases.split(","))
            if (options.generation, fault, phase) not in done
        ]  # fmt: skip
        if left:
            _run_fault(fault, left, options)
    lines = _lines(options.out)
    sys.stdout.write(table(lines, FAULTS, PHASES) + "\n")
    return int(any(line["wrong"] for line in lines))


def _run_fault(fault: str, phases: list[str], options: argparse.Namespace) -> None:
    """A rig of its own for each fault: what one of them has broken is no part of the next."""
    emulated = _emulated(options.generation, options.speed)
    with tempfile.TemporaryDirectory() as folder, listening() as alarms, emulated as rig:
        matrix = Matrix(rig, Path(folder), alarms)

        def keep(verdict: Verdict) -> None:
            line = {"generation": options.generation, "ending": verdict.ending, **asdict(verdict)}
            with options.out.open("a", encoding="utf-8") as file:
                file.write(json.dumps(line) + "\n")

        matrix.run_all(fault, phases, keep)


def _lines(path: Path) -> list[dict[str, Any]]:
    with suppress(FileNotFoundError):
        return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    return []


def _emulated(generation: str, speed: str) -> AbstractContextManager[RunningRig]:
    return running_rig("--generation", generation, "--objects", "household-train", "--speed", speed, camera=True)


if __name__ == "__main__":
    sys.exit(main())
