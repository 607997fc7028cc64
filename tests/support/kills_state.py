"""What a killed command left: the versions of a dataset, what is whole, and what nobody needs."""

from __future__ import annotations

import getpass
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from handsight.datasets import GraspDataset, GraspRepository, SchemaError, verify
from handsight.datasets.store.agreement import lost_refs
from handsight.training.errors import CheckpointError
from handsight.training.run import load_run

DATASETS = ("grasps", "new")
OTHERS = tuple(f"torchinductor_{name}" for name in (getpass.getuser(), "root"))
"""Folders that libraries keep among the temporary files."""


@dataclass(frozen=True, slots=True)
class State:
    """The content of every named version: digests of attempts and of curation, but no ids and no times."""

    versions: dict[str, tuple[tuple[str, ...], str]]

    def is_no_part_of(self, whole: State, *, since: State, at_least: int) -> list[str]:
        """Why this is not between two others, of which one was made of the other by adding attempts to one version."""
        (grown,) = [name for name, version in whole.versions.items() if since.versions.get(name) != version]
        attempts, begin = self.versions.get(grown, ((), ""))[0], since.versions.get(grown, ((), ""))[0]
        full = whole.versions[grown][0]
        faults = [
            f"{name} is {self.versions.get(name)}, expected {version}"
            for name, version in since.versions.items()
            if name != grown and self.versions.get(name) != version
        ]
        added = [one for one in attempts if one not in begin]
        expected = [one for one in full if one not in begin]
        if not {*begin} <= {*attempts} or added != expected[: len(added)]:
            faults.append(f"{grown} holds {attempts}, expected a part of {full}")
        if len(added) < at_least:
            faults.append(f"{grown} has grown by {len(added)}, and {at_least} were acknowledged")
        return faults


Content = tuple[tuple[str, ...], str]

_contents: dict[str, Content] = {}
"""By the snapshot, which never changes."""


def state_of(case: Path) -> State:
    """The state of the datasets of a case."""
    versions = {}
    for name, repository in _datasets(case):
        refs = {**repository.branches(), **{one.name: one.snapshot_id for one in repository.releases().values()}}
        for ref, snapshot_id in refs.items():
            if snapshot_id not in _contents:
                _contents[snapshot_id] = _content(GraspRepository.open(case / name), snapshot_id)
            versions[f"{name} {ref}"] = _contents[snapshot_id]
    return State(versions)


def _datasets(case: Path) -> Iterator[tuple[str, GraspRepository]]:
    for name in DATASETS:
        if (case / name).exists():
            yield name, GraspRepository.open(case / name)


def _content(repository: GraspRepository, snapshot_id: str) -> Content:
    try:
        dataset = GraspDataset(repository, ref=snapshot_id)
        return tuple(dataset.attempts["digest"]), dataset.curation_digest
    except SchemaError:
        return (), "of an older schema"


def whole(case: Path, product: str, *, made: Path | None) -> list[str]:
    """What is there by halves: attempts that do not verify, names that lead nowhere, a run that does not load.

    Versions of the dataset that the case was copied from are not verified while all of its files are there.
    """
    faults = []
    known = set() if made is None or not _has_all_of(case / "grasps", made) else {*_snapshots(made)}
    for name, repository in _datasets(case):
        faults += [one.fault for one in lost_refs(repository)]
        for ref, snapshot_id in repository.branches().items():
            if snapshot_id in known:
                continue
            try:
                report = verify(GraspDataset(repository, ref=ref))
            except SchemaError:
                continue
            faults += [f"{name}@{ref}: {fault}" for fault in (*report.faults.items(), *report.damage)]
    if product == "run" and is_there(case, product):
        try:
            load_run(case / product)
        except CheckpointError as error:
            faults.append(str(error))
    return faults


def _has_all_of(copy: Path, made: Path) -> bool:
    """Whether a dataset has all files of the one it was copied from, but for the names of versions."""
    for path in made.rglob("*"):
        relative = path.relative_to(made)
        if relative.parts[0] not in ("refs", ".handsight") and path.is_file():
            same = copy / relative
            if not same.is_file() or same.stat().st_size != path.stat().st_size:
                return False
    return True


def _snapshots(made: Path) -> list[str]:
    return [path.name for path in (made / "snapshots").iterdir()]


def is_there(case: Path, product: str) -> bool:
    """Whether a command has made what it makes; a run is one once it has its record."""
    return (case / product / "run.json" if product == "run" else case / product).exists()


def leftovers(case: Path) -> tuple[str, ...]:
    """What killed commands left, relative to the case."""
    found = [path for path in case.rglob("*") if ".unfinished-" in path.name or path.name.startswith("handsight-")]
    found += [path for path in case.rglob("*.lock") if path.name != "commit.lock"]
    found += [*case.glob("*/.handsight/writers/*"), *case.glob("*/refs/branch.handsight.draft*")]
    found += [path for path in (case / "tmp").iterdir() if path.name not in OTHERS]
    return tuple(sorted({str(path.relative_to(case)) for path in found}))
