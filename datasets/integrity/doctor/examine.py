"""Runs the checks in order and gathers what they find."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from handsight.datasets.curation.folds import Folds, fold_names, load_folds
from handsight.datasets.errors import CorruptDataError
from handsight.datasets.integrity.doctor.attempts import attempt_findings
from handsight.datasets.integrity.doctor.findings import Finding
from handsight.datasets.integrity.doctor.learning import balance_findings, fold_findings, resimulation_findings
from handsight.datasets.integrity.doctor.near_duplicates import near_duplicate_findings
from handsight.datasets.integrity.doctor.pictures import (
    damage_finding,
    intrinsics_findings,
    picture_facts,
    picture_findings,
)
from handsight.datasets.integrity.doctor.plausibility import plausibility_findings
from handsight.datasets.integrity.doctor.poses import pose_findings
from handsight.datasets.integrity.doctor.structure import structure_findings
from handsight.datasets.integrity.repair import ResimulateAttempt
from handsight.datasets.reading.reader import GraspDataset


@dataclass(frozen=True, slots=True, kw_only=True)
class Diagnosis:
    """Everything the doctor found."""

    findings: tuple[Finding, ...]
    """In the order of their codes."""

    @property
    def ok(self) -> bool:
        """Whether there is neither an error nor a warning."""
        return all(finding.severity == "note" for finding in self.findings)


def doctor(
    dataset: GraspDataset,
    *,
    deep: bool = False,
    resimulate: ResimulateAttempt | None = None,
    resimulated: int = 10,
    seed: int = 0,
    on_picture: Callable[[], None] | None = None,
) -> Diagnosis:
    """Examine a version.

    Args:
        dataset: The version.
        deep: Look at every picture too.
        resimulate: Performs attempts again, to compare their outcome; without it labels are not re-verified.
        resimulated: How many attempts are performed again.
        seed: Decides which.
        on_picture: Called for every picture looked at.
    """
    findings: list[Finding] = []
    try:
        findings += _shallow(dataset)
        if deep:
            findings += _deep(dataset, on_picture)
        if resimulate is not None:
            findings += resimulation_findings(dataset, resimulate, resimulated, np.random.default_rng(seed))
    except CorruptDataError as error:
        findings.append(damage_finding(dataset, error))
    return Diagnosis(findings=tuple(sorted(findings, key=lambda finding: finding.code)))


def _shallow(dataset: GraspDataset) -> Iterator[Finding]:
    yield from structure_findings(dataset)
    yield from intrinsics_findings(dataset)
    yield from attempt_findings(dataset)
    yield from plausibility_findings(dataset)
    yield from pose_findings(dataset)
    yield from balance_findings(dataset)
    yield from fold_findings(dataset, _folds(dataset))


def _deep(dataset: GraspDataset, on_picture: Callable[[], None] | None) -> Iterator[Finding]:
    facts = picture_facts(dataset, on_picture)
    yield from picture_findings(facts)
    yield from near_duplicate_findings(facts.hashes, _folds(dataset))


def _folds(dataset: GraspDataset) -> list[Folds]:
    root = dataset.root
    return [load_folds(root, name) for name in fold_names(root)]
