"""``python -P tests/support/fuzz.py --parser hdf5 --inputs 20000 --seed 3``: spoilt input for every parser.

Inputs are tried in a child process, so that one that crashes, hangs or eats memory is counted and named. An input is
known by parser, seed and index; ``--index`` tries one again in this process, and shows its traceback.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import select
import subprocess
import sys
import tempfile
import traceback
import types
import zlib
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import IO, Any

ROOT = Path(__file__).resolve().parents[2]
if "tests" not in sys.modules:
    # The root stays off the import path: its folder ``datasets`` shadows a well-known package.
    sys.modules["tests"] = types.ModuleType("tests")
    sys.modules["tests"].__path__ = [str(ROOT / "tests")]

import numpy as np  # noqa: E402 -- once `tests` is known
from tests.support.fresh_copy import FreshCopy  # noqa: E402
from tests.support.fuzz_parsers import PARSERS  # noqa: E402

from handsight.cli.errors import EXPECTED  # noqa: E402

LIMIT_S = 5.0
"""Of processor time, of the input's process and those that it starts: a busy machine makes no input slow."""
HANG_S = 60.0
"""By the clock: what takes so long waits for something that does not come."""
LIMIT_BYTES = 10**9
WORDS = ("options", "where", "refs", "environment")
"""Parsers of words, of which good ones are tried by the tests of each command."""
OUTCOMES = ("accepted", "refused", "traceback", "over 5 s", "over 1 GB", "crashed")


class Workbench:
    """Good input of one parser, made once, and a copy of it to spoil for each index."""

    def __init__(self, name: str, folder: Path) -> None:
        """Work in ``folder``, which must be empty."""
        self._name, self._parser, self._folder = name, PARSERS[name], folder
        os.environ["HANDSIGHT_CACHE"] = str(folder / "cache")
        (folder / "good").mkdir()
        self._parser.make(folder / "good")
        self._copy = FreshCopy(folder / "good", folder / "spoilt")

    def attempt(self, seed: int, index: int) -> int:
        """The exit status of one spoilt input.

        Raises:
            Exception: As the parser does; only those of :data:`~handsight.cli.errors.EXPECTED` are as they should be.
        """
        rng = np.random.default_rng([zlib.crc32(self._name.encode()), seed, index])
        place, before = self._copy.restored(), Path.cwd()
        # What a word makes a file of is made here.
        os.chdir(place)
        try:
            return self._parser.parse(place, self._parser.spoil(place, rng))
        finally:
            os.chdir(before)

    def accept(self) -> None:
        """Read the good input, unless all that is spoilt are words.

        Raises:
            Exception: As the parser does.
        """
        if self._name not in WORDS:
            assert self._parser.parse(self._folder / "good", None) == 0

    def outcome(self, seed: int, index: int) -> tuple[str, str]:
        """What became of one input, and the error where there is one that should not be."""
        try:
            status = self.attempt(seed, index)
        except EXPECTED:
            return "refused", ""
        except Exception as error:
            place = traceback.extract_tb(error.__traceback__)
            ours = [frame for frame in place if "/handsight/" in frame.filename] or place
            where = f"{ours[-1].filename.rpartition('/handsight/')[2]}:{ours[-1].lineno}"
            return "traceback", f"{type(error).__name__} at {where}: {str(error).splitlines()[:1]}"
        return ("accepted" if status == 0 else "refused"), ""


def child(name: str, seed: int, first: int, last: int) -> None:
    """Try inputs, and tell of each on a line before and after."""
    said = os.fdopen(os.dup(1), "w")
    # Libraries, and processes that commands start, write where they like.
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    with tempfile.TemporaryDirectory(prefix="handsight-fuzz-") as folder:
        bench = Workbench(name, Path(folder))
        for index in range(first, last):
            print(json.dumps({"begun": index}), file=said, flush=True)
            started_s = _processor_s()
            outcome, error = bench.outcome(seed, index)
            peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
            line = {"index": index, "outcome": outcome, "error": error, "s": _processor_s() - started_s, "peak": peak}
            print(json.dumps(line), file=said, flush=True)


def _processor_s() -> float:
    used = [resource.getrusage(whose) for whose in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


def sweep(name: str, seed: int, inputs: int, first: int = 0) -> tuple[Counter[str], list[str]]:
    """Try inputs in children, one after the other where they end before their time."""
    counts: Counter[str] = Counter()
    findings: list[str] = []
    index, end = first, first + inputs
    while index < end:
        words = [sys.executable, "-P", __file__, "--child", "--parser", name, "--seed", str(seed)]
        words += ["--index", str(index), "--inputs", str(end - index)]
        with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as running:
            assert running.stdout is not None
            index = _follow(running.stdout, name, seed, index, counts, findings)
            running.kill()
    if counts.total() != inputs:
        findings.append(f"{name} seed {seed}: {counts.total()} of {inputs} inputs were tried")
    return counts, findings


def _follow(lines: IO[bytes], name: str, seed: int, index: int, counts: Counter[str], findings: list[str]) -> int:
    """Read what a child says until it ends or hangs; the index to go on with."""
    begun, baseline = False, 0
    while True:
        # Making the good input is no time of any input.
        ready = select.select([lines], [], [], HANG_S if begun else 5 * HANG_S)[0]
        text = lines.readline() if ready else b""
        if not text:
            if begun or not ready:
                outcome = "crashed" if ready else "over 5 s"
                counts[outcome] += 1
                findings.append(f"{name} seed {seed} index {index}: {outcome}")
                return index + 1
            return index + 10**9
        line: dict[str, Any] = json.loads(text)
        if "begun" in line:
            begun = True
            continue
        begun, index = False, line["index"] + 1
        outcome = "over 5 s" if line["s"] > LIMIT_S else line["outcome"]
        outcome = "over 1 GB" if baseline and line["peak"] - baseline > LIMIT_BYTES else outcome
        baseline = baseline or line["peak"]
        counts[outcome] += 1
        if outcome not in ("accepted", "refused"):
            findings.append(f"{name} seed {seed} index {line['index']}: {line['error'] or outcome}")
            if outcome == "over 1 GB":
                return index


def _grouped(findings: list[str]) -> list[str]:
    """The first finding of each kind, and how many more there are."""
    kinds: dict[str, list[str]] = {}
    for finding in findings:
        kinds.setdefault(finding.partition(": ")[2], []).append(finding)
    return [alike[0] + f" (and {len(alike) - 1} more)" * (len(alike) > 1) for alike in kinds.values()]


def main() -> int:
    """Print a table of what became of the inputs; exit status 1 where something did that should not."""
    parser = argparse.ArgumentParser(prog="python -P tests/support/fuzz.py", description=__doc__)
    parser.add_argument("--parser", choices=[*PARSERS, "all"], default="all")
    parser.add_argument("--inputs", type=int, default=200, help="of every parser; with all, fewer of the slow ones")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1, help="parsers that are tried at the same time")
    parser.add_argument("--index", type=int, help="try this one again, and show its traceback")
    parser.add_argument("--child", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        child(options.parser, options.seed, options.index, options.index + options.inputs)
        return 0
    if options.index is not None:
        with tempfile.TemporaryDirectory(prefix="handsight-fuzz-") as folder:
            print("exit status", Workbench(options.parser, Path(folder)).attempt(options.seed, options.index))
        return 0
    bad = 0
    print(f"{'parser':<13}{'inputs':>8}" + "".join(f"{outcome:>11}" for outcome in OUTCOMES), flush=True)
    total = 0
    names = list(PARSERS) if options.parser == "all" else [options.parser]
    inputs = [PARSERS[name].share_of(options.inputs) if len(names) > 1 else options.inputs for name in names]
    with ThreadPoolExecutor(options.jobs) as pool:
        for name, (counts, findings) in zip(
            names, pool.map(sweep, names, [options.seed] * len(names), inputs), strict=True
        ):
            print(f"{name:<13}{counts.total():>8}" + "".join(f"{counts[outcome]:>11}" for outcome in OUTCOMES))
            print("".join(f"  {line}\n" for line in _grouped(findings)), end="", flush=True)
            total += counts.total()
            bad += len(findings)
    print(f"{total} inputs, {bad} findings", flush=True)
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main())
