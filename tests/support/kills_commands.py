"""What can be killed: every command that writes, with what it works on, made once."""

from __future__ import annotations

import os
import time
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from tests.support.factories import make_attempt, make_header, record
from tests.support.foreign_sets import HDF5_MAP, write_hdf5, write_map
from tests.support.image_table import write_images

from handsight.cli.app import run
from handsight.cli.interrupts import INTERRUPTS
from handsight.datasets import (
    Curator,
    GraspDataset,
    GraspRepository,
    Outcome,
    Selection,
    SessionNotFoundError,
    SessionWriter,
    create_branch,
    delete_branch,
    export_dataset,
)

GOLDEN = Path(__file__).resolve().parents[1] / "datasets/scenarios/golden"
AGED_S = 3 * 3600.0
"""How old everything is when a command begins, so that garbage is old enough to be collected."""

NEW = make_header(seed=3, width=64, height=48)
MANY = 1100
"""Attempts that are worth a second process."""
RECORDED = 9
"""Attempts that the program ``record`` records, in commits of two or three."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Doomed:
    """One command."""

    words: tuple[str, ...] = ()
    """Of the command line: ``{case}`` is a folder of this run alone, ``{made}`` what was made once."""
    program: Callable[[Path, Callable[[int], None]], int] | None = None
    """What runs instead of the command line, given the case and whom to tell how many attempts are acknowledged."""
    dataset: str | None = "grasps"
    """What lies at ``{case}/grasps``, made once under this name; None for nothing."""
    grows: bool = False
    """Whether it commits as it goes, so that a killed one may have done a part."""
    product: str = ""
    """A file or folder of the case that is there whole or not at all."""
    needs: tuple[str, ...] = ()
    """What it works on beside that, see :data:`PREPARED`."""
    slow: bool = False
    """Whether it takes seconds, so that the tests leave it out."""


def _record(case: Path, acknowledge: Callable[[int], None]) -> int:
    """Record a session, or go on with it, and tell of every commit."""
    repository = GraspRepository.open(case / "grasps")
    try:
        writer = SessionWriter.resume(repository, NEW)
    except SessionNotFoundError:
        writer = SessionWriter.begin(repository, NEW)
    with writer:
        while writer.next_number < RECORDED:
            writer.append(make_attempt(NEW, writer.next_number))
            if writer.next_number % 5 in (2, 0):
                writer.commit()
                acknowledge(writer.next_number)
    acknowledge(RECORDED)
    return 0


def _dataset(*words: str, **more: object) -> Doomed:
    return Doomed(words=("dataset", *words), **more)  # type: ignore[arg-type]


def _import(source: str, target: str, *words: str, dataset: str | None = "grasps") -> Doomed:
    return _dataset("import", f"{{made}}/{source}", f"{{case}}/{target}", *words, dataset=dataset)


G = "{case}/grasps"

DOOMED: dict[str, Doomed] = {
    "record": Doomed(program=_record, grows=True),
    "init": _dataset("init", "{case}/new", dataset=None),
    "import hdf5": _import("out.hdf5", "grasps"),
    "import zarr": _import("out.zarr", "grasps"),
    "import lerobot": _import("out.lerobot", "grasps"),
    "import images": _import("images", "grasps", "--allow-mismatch"),
    "import --map": _import("mapped/set.hdf5", "grasps", "--map", "{made}/mapped/map.toml", "--allow-mismatch"),
    "import to new": _import("out.hdf5", "new", dataset=None),
    "merge": _dataset("merge", "{made}/other", G),
    "release": _dataset("release", G, "v2"),
    "branch": _dataset("branch", G, "b2"),
    "branch --delete": _dataset("branch", G, "dev", "--delete", "--force"),
    "exclude": _dataset("exclude", G, "--where", "number == 2", "--reason", "blurred"),
    "restore": _dataset("restore", G, "--where", "excluded", "--reason", "sharp after all"),
    "relabel": _dataset("relabel", G, "--where", "number == 3", "--to", "success", "--reason", "it was held"),
    "undo": _dataset("undo", G, "0"),
    "filter": _dataset("filter", G, "held", "--where", "success == 1"),
    "folds": _dataset("folds", G, "five", "--by", "session", "-k", "2"),
    "revert": _dataset("revert", G, "v1"),
    "repair": _dataset("repair", G, "--branch", "mended", dataset="damaged"),
    "migrate": _dataset("migrate", G, "--branch", "new", dataset="old"),
    "gc": _dataset("gc", G),
    "expire": _dataset("expire", G, "--older-than", "0s"),
    "export hdf5": _dataset("export", G, "{case}/out", "--format", "hdf5", product="out"),
    "export zarr": _dataset("export", G, "{case}/out", "--format", "zarr", product="out"),
    "export lerobot": _dataset("export", G, "{case}/out", "--format", "lerobot", product="out"),
    "materialize": _dataset("materialize", G),
    "train": Doomed(
        words=("train", G, "--out", "{case}/run", "--epochs", "3", "--batch", "4", "--resume"), product="run", slow=True
    ),
    "collect sim": Doomed(
        words=("collect", "sim", "{case}/new", "-n", "6", "-w", "2", "--seed", "5", "--resume"),
        dataset=None,
        grows=True,
        slow=True,
    ),
    # These write nothing that lasts, but have children and temporary folders.
    "verify": _dataset("verify", G, "--jobs", "2", dataset="many", slow=True),
    "doctor": _dataset("doctor", G, "--resimulate", "2", dataset="simulated", slow=True),
    "evaluate": Doomed(
        words=("evaluate", "--model", "{made}/run", "--trials", "1", "--workers", "2", "--methods", "cem-1"),
        needs=("run",),
        slow=True,
    ),
}

PREPARED: dict[str, tuple[str, ...]] = {
    "simulated": ("collect", "sim", "{made}/simulated", "-n", "2", "-w", "1"),
    "run": ("train", "{made}/grasps", "--out", "{made}/run", "--epochs", "1", "--batch", "4"),
}
"""Commands that make what only some commands work on."""


def make_all(folder: Path) -> None:
    """Fill an empty folder with what the commands work on."""
    _make_grasps(folder / "grasps")
    other = make_header(seed=2, width=64, height=48)
    repository = GraspRepository.create(folder / "other")
    record(repository, other, [make_attempt(other, number) for number in range(6)])
    exported = GraspDataset(repository, ref="main")
    for format in ("hdf5", "zarr", "lerobot"):
        export_dataset(exported, folder / f"out.{format}", format=format)
    write_images(folder / "images", 4)
    (folder / "mapped").mkdir()
    write_hdf5(folder / "mapped" / "set.hdf5")
    write_map(folder / "mapped" / "map.toml", HDF5_MAP)
    _make_damaged(folder / "damaged")
    with zipfile.ZipFile(GOLDEN / "schema-1.zip") as archive:
        archive.extractall(folder / "old")
    then = time.time() - AGED_S
    for path in folder.rglob("*"):
        os.utime(path, (then, then))


def _make_damaged(path: Path) -> None:
    """One session, of which two pictures are zeroed."""
    header = make_header(seed=1, width=64, height=48)
    attempts = [make_attempt(header, number, outcome=Outcome.HELD) for number in range(4)]
    record(GraspRepository.create(path), header, attempts)
    chunks = sorted((path / "chunks").iterdir(), key=lambda chunk: chunk.stat().st_size)
    for chunk in chunks[-2:]:
        chunk.write_bytes(bytes(chunk.stat().st_size))


def make_many(path: Path) -> None:
    """So many attempts that two processes verify them."""
    header = make_header(seed=5)
    attempts = (make_attempt(header, number, outcome=Outcome.ABORTED) for number in range(MANY))
    record(GraspRepository.create(path), header, attempts, every=MANY)


def _make_grasps(path: Path) -> None:
    """Two sessions, some curation, a release, a branch with a session of its own, and garbage."""
    repository = GraspRepository.create(path)
    for seed, size in ((1, 6), (4, 3)):
        header = make_header(seed=seed, width=64, height=48)
        outcomes = [Outcome.EMPTY if number % 2 else Outcome.HELD for number in range(size)]
        record(repository, header, [make_attempt(header, at, outcome=one) for at, one in enumerate(outcomes)])
    curator = Curator(repository, author="anna")
    curator.exclude(Selection(where="number == 1"), "dark")
    repository.release("v1")
    curator.exclude(Selection(where="number == 5"), "dark")
    for branch, seed in (("dev", 6), ("gone", 7)):
        create_branch(repository, branch)
        header = make_header(seed=seed, width=64, height=48)
        with SessionWriter.begin(repository, header, branch=branch) as writer:
            writer.append(make_attempt(header, 0))
    delete_branch(repository, "gone", force=True)


def carry_out(name: str, case: Path, made: Path, acknowledge: Callable[[int], None]) -> int:
    """Run one command in this process; its exit status."""
    if name in PREPARED and name not in DOOMED:
        return main([word.format(made=made) for word in PREPARED[name]])
    doomed = DOOMED[name]
    if doomed.program is not None:
        return doomed.program(case, acknowledge)
    status = main([word.format(case=case, made=made) for word in doomed.words])
    acknowledge(status)
    return status


def main(words: list[str]) -> int:
    """What the executable does; its exit status."""
    INTERRUPTS.install()
    status = run(words)
    INTERRUPTS.end()
    return status
