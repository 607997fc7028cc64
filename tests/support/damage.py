"""``python -P tests/support/damage.py --mutations 200 --seed 0``: what damage to any stored file comes to.

One file of a small dataset with everything in it is changed at a time. Either ``verify --all`` finds that, or it is
proved to be harmless: every branch and release has the content and the curation that it had, and every attempt is read
as it was recorded. A mutation is known by seed and index; ``--index`` shows what one of them comes to.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import io
import json
import sys
import tempfile
import traceback
import types
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
if "tests" not in sys.modules:
    # The root stays off the import path: its folder ``datasets`` shadows a well-known package.
    sys.modules["tests"] = types.ModuleType("tests")
    sys.modules["tests"].__path__ = [str(ROOT / "tests")]

import icechunk  # noqa: E402 -- once `tests` is known
import numpy as np  # noqa: E402
from tests.support.factories import make_attempt, make_header  # noqa: E402

from handsight.cli.app import run  # noqa: E402
from handsight.datasets import (  # noqa: E402
    VIEWPOINTS,
    Curator,
    GraspDataset,
    GraspRepository,
    Outcome,
    Selection,
    SessionWriter,
    create_branch,
    delete_branch,
    make_folds,
    materialize,
    merge,
    save_filter,
)
from handsight.datasets.curation.folds import fold_names, load_folds  # noqa: E402

KINDS = ("refs", "snapshots", "manifests", "transactions", "chunks", "config.yaml", ".handsight")
"""First parts of the paths of stored files."""
WAYS = ("flip", "zero", "truncate", "empty", "delete", "swap")
OUTCOMES = ("found", "harmless", "missed", "refused", "traceback")
_BLOCK = 64
_SIZE = {"width": 24, "height": 16}


@dataclass(frozen=True, slots=True, kw_only=True)
class Mutation:
    """What was done to which file, and what that came to."""

    way: str
    file: str
    outcome: str
    said: str

    @property
    def kind(self) -> str:
        return self.file.partition("/")[0]


def make_dataset(folder: Path) -> Path:
    """A dataset with three branches, two releases, what a merge brought, decisions, folds, a filter and a cache."""
    path = folder / "grasps"
    repository = GraspRepository.create(path)
    _record(repository, 1, 12)
    repository.release("v1", message="first")
    create_branch(repository, "work", "v1")
    _record(repository, 3, 5, branch="work")
    other = GraspRepository.create(folder / "other")
    _record(other, 4, 5)
    merge(GraspDataset(other, ref="main"), repository)
    curator = Curator(repository, author="anna")
    for number in range(2):
        curator.exclude(Selection(where=f"number == {number}"), np.random.default_rng(number).bytes(200).hex())
    save_filter(repository, "few", "number < 4", author="anna")
    make_folds(repository, "halves", by="scene", count=2, seed=0, author="anna")
    create_branch(repository, "idle")
    create_branch(repository, "gone")
    _record(repository, 5, 2, branch="gone")
    delete_branch(repository, "gone", force=True)
    repository.release("v2", message="second")
    materialize(GraspDataset(repository, ref="v2"))
    return path


def _record(repository: GraspRepository, seed: int, size: int, branch: str = "main") -> None:
    header = make_header(seed=seed, **_SIZE)
    kinds = (Outcome.HELD, Outcome.EMPTY)
    attempts = [make_attempt(header, number, outcome=kinds[number % 2]) for number in range(size)]
    with SessionWriter.begin(repository, header, branch) as writer:
        for attempt in attempts:
            writer.append(attempt)
            if writer.next_number % 5 == 0:
                writer.commit()


def facts(path: Path) -> dict[str, object]:
    """All that must not change unnoticed, by branch and release: content, curation, attempts, filters and folds."""
    repository = GraspRepository.open(path)
    known: dict[str, object] = {}
    for name in sorted([*repository.branches(), *repository.releases()]):
        dataset = GraspDataset(repository, ref=name)
        pictures = hashlib.sha256()
        for viewpoint in VIEWPOINTS:
            for attempt, frame in dataset.frames(viewpoint):
                pictures.update(attempt.encode() + frame.rgb.tobytes() + frame.depth.tobytes())
                pictures.update(frame.pose_base_tool.tobytes())
        folds = [load_folds(dataset.root, one).fold.to_csv() for one in fold_names(dataset.root)]
        known[name] = (
            dataset.digest,
            dataset.curation_digest,
            pictures.digest(),
            dataset.attempts.to_csv(),
            folds,
        )
    return known


class Bench:
    """A dataset of which one file after the other is damaged and put back."""

    def __init__(self, folder: Path) -> None:
        """Work in ``folder``, which must be empty."""
        icechunk.set_logs_filter("off")
        self.path = make_dataset(folder)
        self._facts = facts(self.path)
        assert self.verified() == (0, ""), "the dataset is not sound to begin with"
        files = sorted(file for file in self.path.rglob("*") if file.is_file() and file.suffix != ".lock")
        self._files = {kind: [one for one in files if one.relative_to(self.path).parts[0] == kind] for kind in KINDS}

    def attempt(self, seed: int, index: int) -> Mutation:
        """Damage one file, see what it comes to, and put it back. Kinds and ways are taken by turns."""
        rng = np.random.default_rng([seed, index])
        kind = KINDS[index % len(KINDS)]
        way = WAYS[(index // len(KINDS)) % len(WAYS)]
        files = self._files[kind]
        file, other = (files[int(rng.integers(len(files)))] for _ in range(2))
        if way == "swap" and other == file:
            way = "flip"
        before = {one: one.read_bytes() for one in (file, other)}
        mutate(file, other, way, rng)
        try:
            outcome, said = self._outcome()
        finally:
            for one, content in before.items():
                one.write_bytes(content)
        what = f"{file.relative_to(self.path)}" + (f" and {other.relative_to(self.path)}" if way == "swap" else "")
        return Mutation(way=way, file=what, outcome=outcome, said=said)

    def verified(self) -> tuple[int, str]:
        """Exit status of ``verify --all``, and the first thing that it names."""
        out, err = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            status = run(["dataset", "verify", str(self.path), "--all", "--json", "--jobs", "1"])
        if status == 2:
            return status, err.getvalue()
        report = json.loads(out.getvalue())
        named = [*report["faults"].values(), *report["damage"], *report["lost_refs"]]
        named += [f"{one['file']} {one['fault']}" for one in report["files"]]
        return status, named[0] if named else ""

    def _outcome(self) -> tuple[str, str]:
        try:
            status, said = self.verified()
        except BaseException as error:
            return "traceback", "".join(traceback.format_exception(error)[-3:])
        if status == 1 and said:
            return "found", said
        if status != 0:
            return "refused", said
        try:
            return ("harmless", "") if facts(self.path) == self._facts else ("missed", "other content")
        except Exception as error:
            return "missed", f"{type(error).__name__}: {error}"


def mutate(file: Path, other: Path, way: str, rng: np.random.Generator) -> None:
    """Change a file in one of :data:`WAYS`."""
    content = bytearray(file.read_bytes())
    at = int(rng.integers(max(1, len(content))))
    if way == "delete":
        file.unlink()
    elif way == "swap":
        file.write_bytes(other.read_bytes())
        other.write_bytes(content)
    elif way == "flip" and content:
        content[at] ^= 1 << int(rng.integers(8))
        file.write_bytes(content)
    elif way == "zero":
        content[at : at + _BLOCK] = bytes(len(content[at : at + _BLOCK]))
        file.write_bytes(content)
    else:
        file.write_bytes(content[:at] if way == "truncate" else b"")


def main() -> int:
    """Print what the mutations came to, by kind of file; exit status 1 where one was missed."""
    parser = argparse.ArgumentParser(prog="python -P tests/support/damage.py", description=__doc__)
    parser.add_argument("--mutations", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--index", type=int, help="try this one again, and show what it comes to")
    options = parser.parse_args()
    counts: dict[str, Counter[str]] = {kind: Counter() for kind in KINDS}
    bad = []
    with tempfile.TemporaryDirectory(prefix="handsight-damage-") as folder:
        bench = Bench(Path(folder))
        if options.index is not None:
            print(bench.attempt(options.seed, options.index))
            return 0
        for index in range(options.mutations):
            one = bench.attempt(options.seed, index)
            counts[one.kind][one.outcome] += 1
            if one.outcome not in ("found", "harmless"):
                bad.append(f"  seed {options.seed} index {index}: {one.way} {one.file}: {one.outcome}: {one.said}")
                print(bad[-1], flush=True)
    print(f"{'file':<14}{'mutations':>10}" + "".join(f"{outcome:>11}" for outcome in OUTCOMES))
    for kind, count in counts.items():
        print(f"{kind:<14}{sum(count.values()):>10}" + "".join(f"{count[outcome]:>11}" for outcome in OUTCOMES))
    return int(bool(bad))


if __name__ == "__main__":
    sys.exit(main())
