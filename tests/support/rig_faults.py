"""Every fault of the emulated rig in every phase of an attempt, and what becomes of it.

As a program it runs the whole matrix and prints a line of JSON for each case:
``python -m tests.support.rig_faults [--generation cb3] [--faults a,b] [--phases c,d]``. A few cases are tests.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass, field
from pathlib import Path

from tests.support.emulated_rig import CONTROL_PORT, RunningRig, running_rig
from tests.support.rig_files import station_factory

from handsight.collection.collector import CollectSettings
from handsight.collection.errors import CollectionError
from handsight.collection.ur10.session import collect_on_rig
from handsight.collection.ur10.station import Ur10StationFactory
from handsight.datasets import GraspDataset, GraspRepository
from handsight.datasets.records import GraspAttempt, Outcome

PHASES = ("look", "reach", "descend", "close", "lift", "shake", "release")
FAULTS = (
    "drop",
    "freeze",
    "kill-controller",
    "protective-stop",
    "emergency-stop",
    "system-emergency-stop",
    "safeguard-stop",
    "safety-fault",
    "safety-violation",
    "force-noise",
    "force-drift",
    "in-use",
    "remote-off",
    "gripper-fault",
    "gripper-silent:s=3",
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
)
ATTEMPTS = 2
LOWEST_M = 0.0
"""Fingertips must not have been below the table."""
POWER_CYCLE = """
import json, socket, sys, time
with socket.create_connection((sys.argv[1], int(sys.argv[2])), timeout=10) as c:
    c.sendall(json.dumps({"do": "camera-power-cycle"}).encode() + b"\\n")
    c.makefile().readline()
time.sleep(1)
"""


@dataclass(slots=True, kw_only=True)
class Verdict:
    """What became of one fault."""

    fault: str
    phase: str
    fired: int = 0
    outcomes: list[str] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)
    paused: str = ""
    seconds: float = 0.0
    wrong: list[str] = field(default_factory=list)
    """What must not have happened."""

    @property
    def ending(self) -> str:
        """How the rig got over it."""
        if self.paused:
            return "paused"
        return "recovered" if self.failures else "unharmed"


class Matrix:
    """One emulated rig that is driven through cases."""

    def __init__(self, rig: RunningRig, folder: Path) -> None:
        """Collect into ``folder``."""
        self.rig = rig
        program = folder / "power_cycle.py"
        program.write_text(POWER_CYCLE, encoding="utf-8")
        self.factory: Ur10StationFactory = station_factory(
            folder, rig, power_cycle=(sys.executable, str(program), rig.robot, str(CONTROL_PORT))
        )
        self.dataset = folder / "grasps"
        self.told: list[GraspAttempt] = []

    def run(self, fault: str, phase: str) -> Verdict:
        """Let one fault happen in one phase of the next attempts."""
        verdict = Verdict(fault=fault, phase=phase)
        begun = time.monotonic()
        self.rig.do("clear")
        self.rig.do("release")
        # What fell off the table, and what a fault of before has left in the jaws.
        self.rig.do("refill")
        before = len(self.rig.do("status")["fired"])
        armed = self.rig.do("fault", fault=f"{fault}@{phase}")
        if "error" in armed:
            raise AssertionError(armed["error"])
        self._collect(verdict)
        status = self.rig.do("status")
        verdict.fired = len(status["fired"]) - before
        if status["lowest_tip_z_m"] < LOWEST_M:
            verdict.wrong.append(f"fingertips were at {status['lowest_tip_z_m']:.4f} m")
        self._check_kept(verdict)
        verdict.seconds = time.monotonic() - begun
        return verdict

    def _collect(self, verdict: Verdict) -> None:
        here = len(self.told)

        def told(attempt: GraspAttempt, _: int) -> None:
            self.told.append(attempt)
            verdict.outcomes.append(attempt.outcome.name)
            if attempt.failure:
                verdict.failures.append(attempt.failure[:160])
            self._check_label(attempt, verdict)

        try:
            report = collect_on_rig(
                GraspRepository.open_or_create(self.dataset),
                self.factory,
                CollectSettings(attempts=here + ATTEMPTS),
                resume=True,
                on_attempt=told,
            )
            verdict.paused = report.paused
        except CollectionError as error:
            # Raised where nothing has moved yet: the session did not begin.
            verdict.paused = f"{type(error).__name__}: {error}"

    def _check_label(self, attempt: GraspAttempt, verdict: Verdict) -> None:
        if attempt.outcome not in (Outcome.HELD, Outcome.EMPTY):
            return
        held = any(one["held"] for one in self.rig.do("scene")["objects"])
        if held != attempt.success:
            verdict.wrong.append(f"attempt {attempt.number} is labelled {attempt.outcome.name}, held in truth: {held}")

    def _check_kept(self, verdict: Verdict) -> None:
        kept = len(GraspDataset.open(str(self.dataset)).attempts) if self.told else 0
        if kept != len(self.told):
            verdict.wrong.append(f"{len(self.told)} attempts were told of, {kept} are kept")


def main() -> int:
    """Run cases and print what became of each; 1 if anything went wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--generation", default="e-series")
    parser.add_argument("--faults", default=",".join(FAULTS))
    parser.add_argument("--phases", default=",".join(PHASES))
    parser.add_argument("--speed", default="8")
    options = parser.parse_args()
    bad = 0
    for fault in options.faults.split(","):
        # A rig of its own for each fault: what one of them has broken is no part of the next.
        with tempfile.TemporaryDirectory() as folder, _emulated(options.generation, options.speed) as rig:
            matrix = Matrix(rig, Path(folder))
            for phase in options.phases.split(","):
                verdict = matrix.run(fault, phase)
                bad += bool(verdict.wrong)
                sys.stdout.write(json.dumps({"ending": verdict.ending, **asdict(verdict)}) + "\n")
                sys.stdout.flush()
    return int(bool(bad))


def _emulated(generation: str, speed: str) -> AbstractContextManager[RunningRig]:
    return running_rig("--generation", generation, "--objects", "household-train", "--speed", speed, camera=True)


if __name__ == "__main__":
    sys.exit(main())
