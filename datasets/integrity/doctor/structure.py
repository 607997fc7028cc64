"""GD-1xx: whether the dataset hangs together."""

from __future__ import annotations

from collections.abc import Iterator

import zarr

from handsight.datasets.format.arrays import group_at
from handsight.datasets.format.schema import SESSIONS
from handsight.datasets.format.sessions import attribute_damage
from handsight.datasets.integrity.doctor.findings import Finding, attempt_finding, dataset_finding
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.store.agreement import lost_refs
from handsight.datasets.writing.batches import session_arrays


def structure_findings(dataset: GraspDataset) -> Iterator[Finding]:
    """Sessions, lengths, ids, curation, names of versions."""
    root = dataset.root
    for session in dataset.sessions:
        group = group_at(root, f"{SESSIONS}/{session.ulid}")
        if session.status == "open":
            yield dataset_finding(
                "GD-101", "note", f"session {session.ulid} is open: its collector has not sealed it yet"
            )
        yield from _length_findings(session.ulid, group)
        for fault in attribute_damage(group.attrs.asdict()):
            yield dataset_finding("GD-107", "error", f"session {session.ulid}: {fault}")
    yield from _id_findings(dataset)
    for lost in lost_refs(dataset.repository):
        yield dataset_finding("GD-108", "error", lost.fault)


def _length_findings(ulid: str, group: zarr.Group) -> Iterator[Finding]:
    lengths = {path: array.shape[0] for path, array in session_arrays(group).items()}
    if len(set(lengths.values())) > 1:
        listed = ", ".join(f"{path} {length}" for path, length in lengths.items())
        yield dataset_finding("GD-103", "error", f"arrays of session {ulid} differ in length: {listed}")


def _id_findings(dataset: GraspDataset) -> Iterator[Finding]:
    table = dataset.attempts
    curated = {one for decision in dataset.overlay.decisions for one in decision.attempts}
    yield from attempt_finding(
        "GD-105",
        "warning",
        sorted(curated - set(table.index)),
        "{attempts} curated and not in this version",
    )
