"""``python -P tests/support/kills.py --kills 1000 --seed 3``: every command that writes, killed and run again.

One process forks a child for each kill and opens no dataset itself, so that commands start at once (kill_points.py).
Another, this one, looks at what the killed command left: every version that was there is as it was, what was
acknowledged is there, whatever has a name is whole, and the same command, run again, ends as if nothing had happened
and leaves nothing behind. A kill is known by its seed and index; ``--index`` makes one again and keeps its folder.
"""

from __future__ import annotations

import argparse
import gc
import importlib
import json
import os
import pkgutil
import shutil
import subprocess
import sys
import tempfile
import types
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
if "tests" not in sys.modules:
    # The root stays off the import path: its folder ``datasets`` shadows a well-known package.
    sys.modules["tests"] = types.ModuleType("tests")
    sys.modules["tests"].__path__ = [str(ROOT / "tests")]

import numpy as np  # noqa: E402 -- once `tests` is known
from tests.support.kill_points import run_in_child, run_interrupted, run_killed  # noqa: E402
from tests.support.kills_commands import DOOMED, PREPARED, carry_out, make_all, make_many  # noqa: E402
from tests.support.kills_state import DATASETS, OTHERS, State, is_there, leftovers, state_of, whole  # noqa: E402

import handsight.cli  # noqa: E402
import handsight.datasets  # noqa: E402
import handsight.training  # noqa: E402
from handsight.cli.app import run  # noqa: E402
from handsight.cli.interrupts import INTERRUPTED  # noqa: E402
from handsight.datasets import GraspRepository, collect_garbage  # noqa: E402

KINDS = ("lost", "stuck", "left")
"""What can be wrong after a kill."""
AT_A_MOMENT = 0.2
"""Share of kills at any moment instead of at a change to the file system."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """One run of a command."""

    status: int | None
    points: int
    elapsed_s: float
    outlived: bool
    acknowledged: tuple[int, ...]
    said: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What one kill did."""

    index: int
    command: str
    killed: bool
    """Whether it came in time."""
    at: str
    lost: tuple[str, ...] = ()
    """What was acknowledged, or there before, and is not there any more; and what is there in part."""
    stuck: tuple[str, ...] = ()
    """Why the next command did not end as it should."""
    left: tuple[str, ...] = ()
    """What is still there after the next command."""

    @property
    def ok(self) -> bool:
        """Whether all is well."""
        return not (self.lost or self.stuck or self.left)


@dataclass(frozen=True, slots=True, kw_only=True)
class Normal:
    """What a command does when nobody kills it."""

    before: State
    after: State
    faults: tuple[str, ...]
    """What was not whole from the beginning."""
    points: int
    elapsed_s: float
    files: tuple[str, ...]
    """What is in the case in the end, at its top and in its product."""


class Bench:
    """Kills commands in a folder, which must be empty.

    To be closed, which ends the process that forks.
    """

    def __init__(self, folder: Path) -> None:
        self._folder, self._made = folder, folder / "made"
        self._made.mkdir()
        make_all(self._made)
        words = [sys.executable, "-P", __file__, "--forks"]
        self._forks = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self._normal: dict[str, Normal] = {}

    def close(self) -> None:
        """End it."""
        assert self._forks.stdin is not None
        assert self._forks.stdout is not None
        self._forks.stdin.close()
        self._forks.wait()
        self._forks.stdout.close()

    def kill(self, command: str, seed: int, index: int, *, interrupts: int = 0, keep: bool = False) -> Outcome:
        """Run a command that is killed, or interrupted so many times, look, run it again, and look again."""
        normal = self._normal_of(command)
        rng = np.random.default_rng([seed, index])
        point = after_s = None
        if not normal.points or (rng.random() < AT_A_MOMENT and not interrupts):
            after_s = float(rng.uniform(0, normal.elapsed_s))
        else:
            point = int(rng.integers(1, normal.points + 1))
        at = f"change {point} of {normal.points}" if point else f"{after_s:.3f} of {normal.elapsed_s:.3f} s"
        with self._case(command, keep=keep) as case:
            killed = self._run(command, case, point=point, after_s=after_s, interrupts=interrupts)
            lost = self._lost(command, case, normal, killed)
            if interrupts:
                lost += _impolite(killed)
            product = DOOMED[command].product
            done = state_of(case) == normal.after and (not product or is_there(case, product))
            again = self._run(command, case, free=True)
            if done:
                # It may have had nothing left to do; the next one that writes is another.
                for dataset in (case / name for name in DATASETS if (case / name).exists()):
                    collect_garbage(GraspRepository.open(dataset), dry_run=False)
            stuck: list[str] = []
            left: tuple[str, ...] = ()
            if again.status not in ((0, 2) if done else (0,)) or "Traceback" in again.said:
                stuck.append(f"the next one ended with {again.status}: {again.said[-2000:]}")
            else:
                if state_of(case) != normal.after:
                    stuck.append(f"after the next one: {state_of(case)}, expected {normal.after}")
                stuck += [one for one in self._faults(command, case) if one not in normal.faults]
                left = leftovers(case)
                if not left and _files(case, command) != normal.files:
                    left = tuple(sorted({*_files(case, command)} ^ {*normal.files}))
            if killed.outlived:
                stuck.append("something that it started went on for 10 s after it")
        return Outcome(
            index=index,
            command=command,
            killed=killed.status in (None, INTERRUPTED),
            at=at,
            lost=tuple(lost),
            stuck=tuple(stuck),
            left=left,
        )

    def _lost(self, command: str, case: Path, normal: Normal, killed: Run) -> list[str]:
        """What is missing, or there by halves, after a kill."""
        doomed = DOOMED[command]
        now = state_of(case)
        faults = [one for one in self._faults(command, case) if one not in normal.faults]
        if doomed.grows:
            acknowledged = max(killed.acknowledged, default=0)
            faults += now.is_no_part_of(normal.after, since=normal.before, at_least=acknowledged)
        elif killed.acknowledged not in ((), (INTERRUPTED,)) and now != normal.after:
            faults.append(f"acknowledged, but {now}, expected {normal.after}")
        elif now not in (normal.before, normal.after):
            faults.append(f"{now}, expected {normal.before} or {normal.after}")
        if "Traceback" in killed.said:
            faults.append(killed.said[-2000:])
        return faults

    def _faults(self, command: str, case: Path) -> list[str]:
        doomed = DOOMED[command]
        return whole(case, doomed.product, made=None if doomed.dataset is None else self._made / doomed.dataset)

    def _normal_of(self, command: str) -> Normal:
        if command not in self._normal:
            with self._case(command) as case:
                before, faults = state_of(case), tuple(whole(case, DOOMED[command].product, made=None))
                normal = self._run(command, case)
                assert normal.status == 0, (command, normal)
                assert not leftovers(case), (command, leftovers(case))
                self._normal[command] = Normal(
                    before=before,
                    after=state_of(case),
                    faults=faults,
                    points=normal.points,
                    elapsed_s=normal.elapsed_s,
                    files=_files(case, command),
                )
        return self._normal[command]

    @contextmanager
    def _case(self, command: str, *, keep: bool = False) -> Iterator[Path]:
        case = self._folder / "case"
        shutil.rmtree(case, ignore_errors=True)
        for name in ("tmp", "cache"):
            (case / name).mkdir(parents=True)
        dataset = DOOMED[command].dataset
        if dataset == "many" and not (self._made / dataset).exists():
            make_many(self._made / dataset)
        for one in (dataset, *DOOMED[command].needs):
            if one in PREPARED and not (self._made / one).exists():
                made = self._run(one, case, free=True)
                assert made.status == 0, made
        if dataset is not None:
            shutil.copytree(self._made / dataset, case / "grasps")
        try:
            yield case
        finally:
            if not keep:
                shutil.rmtree(case)

    def _run(
        self,
        command: str,
        case: Path,
        *,
        free: bool = False,
        point: int | None = None,
        after_s: float | None = None,
        interrupts: int = 0,
    ) -> Run:
        asked = {"command": command, "case": str(case), "made": str(self._made), "free": free}
        asked |= {"point": point, "after_s": after_s, "interrupts": interrupts}
        assert self._forks.stdin is not None
        assert self._forks.stdout is not None
        self._forks.stdin.write(json.dumps(asked) + "\n")
        self._forks.stdin.flush()
        fate = json.loads(self._forks.stdout.readline())
        told, said = case / "told", case / "said"
        numbers = tuple(map(int, told.read_text().split())) if told.exists() else ()
        words = said.read_text(errors="replace") if said.exists() else ""
        for one in (told, said):
            one.unlink(missing_ok=True)
        return Run(acknowledged=numbers, said=words, **fate)


def _impolite(interrupted: Run) -> list[str]:
    """What an interrupted command should not have said or done."""
    if interrupted.status != INTERRUPTED:
        return [f"interrupted, it ended with {interrupted.status}: {interrupted.said}"]
    lines = [line for line in interrupted.said.splitlines() if line != "still putting away what is there"]
    told = [line for line in lines if line.startswith("interrupted: ")]
    return [] if len(told) == 1 and lines[-1:] == told else [f"interrupted, it said: {interrupted.said}"]


def _files(case: Path, command: str) -> tuple[str, ...]:
    """Names at the top of a case, beside a dataset's own, and in the product."""
    product = case / (DOOMED[command].product or "none")
    found = [*case.iterdir(), *(case / "tmp").iterdir(), *product.rglob("*")]
    return tuple(sorted(str(path.relative_to(case)) for path in found if path.name not in OTHERS))


def fork_on_demand() -> None:
    """Fork a child for every line of the standard input, and tell its fate on one of the standard output.

    Everything is imported once, so that no child has to.
    """
    for package in (handsight.datasets, handsight.cli, handsight.training):
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            importlib.import_module(module.name)
    # The libraries of the command line import more when they first read words.
    run(["dataset", "exclude", "/nowhere", "0", "--reason", "none"])
    gc.freeze()
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    for line in sys.stdin:
        asked: dict[str, Any] = json.loads(line)
        work = partial(_work, asked["command"], Path(asked["case"]), Path(asked["made"]))
        if asked["free"]:
            fate = run_in_child(work)
        elif asked["interrupts"]:
            fate = run_interrupted(work, point=asked["point"], times=asked["interrupts"])
        else:
            fate = run_killed(work, point=asked["point"], after_s=asked["after_s"])
        print(json.dumps(asdict(fate)), file=answers, flush=True)


def _work(command: str, case: Path, made: Path) -> int:
    """In the child."""
    said = os.open(case / "said", os.O_CREAT | os.O_WRONLY | os.O_APPEND)
    os.dup2(said, 1)
    os.dup2(said, 2)
    told = os.open(case / "told", os.O_CREAT | os.O_WRONLY | os.O_APPEND)
    os.environ |= {"TMPDIR": str(case / "tmp"), "HANDSIGHT_CACHE": str(case / "cache"), "HANDSIGHT_AUTHOR": "anna"}
    tempfile.tempdir = None

    def acknowledge(number: int) -> None:
        os.write(told, b"%d\n" % number)

    return carry_out(command, case, made, acknowledge)


@dataclass(slots=True)
class Table:
    """Counts for each command."""

    kills: Counter[str] = field(default_factory=Counter)
    counts: dict[str, Counter[str]] = field(default_factory=lambda: {kind: Counter() for kind in ("late", *KINDS)})

    def add(self, outcome: dict[str, Any]) -> None:
        """Count one."""
        self.kills[outcome["command"]] += 1
        self.counts["late"][outcome["command"]] += not outcome["killed"]
        for kind in KINDS:
            self.counts[kind][outcome["command"]] += bool(outcome[kind])

    def lines(self) -> Iterator[str]:
        """The table."""
        yield f"{'command':<18}{'kills':>7}" + "".join(f"{kind:>7}" for kind in self.counts)
        for command in DOOMED:
            yield f"{command:<18}{self.kills[command]:>7}" + "".join(f"{n[command]:>7}" for n in self.counts.values())
        yield f"{'all':<18}{self.kills.total():>7}" + "".join(f"{n.total():>7}" for n in self.counts.values())


def schedule() -> list[str]:
    """Commands in turn; those that take seconds come a third as often."""
    fast = [name for name, doomed in DOOMED.items() if not doomed.slow]
    return [*fast, *fast, *DOOMED]


def main() -> int:
    """Print a table of what became of the kills; exit status 1 where anything was lost, stuck or left."""
    parser = argparse.ArgumentParser(prog="python -P tests/support/kills.py", description=__doc__)
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0, help="index of the first kill")
    parser.add_argument("--command", choices=DOOMED, action="append", help="kill this one alone; may be given again")
    parser.add_argument("--interrupts", type=int, default=0, help="press Ctrl-C so many times instead")
    parser.add_argument("--index", type=int, help="make this kill again, and keep its folder")
    parser.add_argument("--log", type=Path, help="file of outcomes; those that are in it are not made again")
    parser.add_argument("--forks", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.forks:
        fork_on_demand()
        return 0
    commands = options.command or schedule()
    logged = options.log.read_text().splitlines() if options.log and options.log.exists() else []
    made = [json.loads(line) for line in logged]
    done = {outcome["index"] for outcome in made}
    indices = range(options.first, options.first + options.kills) if options.index is None else [options.index]
    fast = Path("/dev/shm")
    folder = Path(tempfile.mkdtemp(prefix="handsight-kills-", dir=fast if fast.is_dir() else None))
    bench = Bench(folder)
    try:
        for index in indices:
            if index in done and options.index is None:
                continue
            outcome = bench.kill(
                commands[index % len(commands)],
                options.seed,
                index,
                interrupts=options.interrupts,
                keep=options.index is not None,
            )
            made.append(asdict(outcome))
            if not outcome.ok:
                print(json.dumps(made[-1], indent=1), flush=True)
            if options.log:
                with options.log.open("a") as file:
                    print(json.dumps(made[-1]), file=file)
    finally:
        bench.close()
        if options.index is None:
            shutil.rmtree(folder)
        else:
            print(f"its folder is {folder}")
    table = Table()
    for one in made:
        table.add(one)
    print("\n".join(table.lines()))
    return int(any(one[kind] for one in made for kind in KINDS))


if __name__ == "__main__":
    sys.exit(main())
