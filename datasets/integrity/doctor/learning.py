"""GD-4xx and GD-5xx: whether the labels can be learned from and trusted."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from handsight.datasets.curation.folds import Folds, fold_faults
from handsight.datasets.errors import counted
from handsight.datasets.format.decisions import trainable
from handsight.datasets.format.digest import attempt_digest
from handsight.datasets.format.schema import parse_attempt_id
from handsight.datasets.integrity.doctor.findings import Finding, attempt_finding, dataset_finding
from handsight.datasets.integrity.repair import ResimulateAttempt
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.records import Outcome

_RAREST = 0.05
_FEWEST = 50
"""Balance is not judged on fewer labelled attempts."""


def balance_findings(dataset: GraspDataset) -> Iterator[Finding]:
    """Whether both labels occur often enough."""
    labels = dataset.attempts["success"][trainable(dataset.attempts)]
    share = float(labels.mean()) if len(labels) else 0.5
    if len(labels) >= _FEWEST and not _RAREST <= share <= 1 - _RAREST:
        expected = f"expected {_RAREST:.0%} to {1 - _RAREST:.0%}"
        message = f"{share:.1%} of {counted(len(labels), 'labelled attempt')} succeed, {expected}"
        yield dataset_finding("GD-401", "warning", message)


def fold_findings(dataset: GraspDataset, folds: list[Folds]) -> Iterator[Finding]:
    """Whether the stored folds still divide this version without leaks."""
    for division in folds:
        for fault in fold_faults(dataset, division):
            yield dataset_finding("GD-402", "error", f"folds {division.name!r}: {fault}")


def resimulation_findings(
    dataset: GraspDataset, resimulate: ResimulateAttempt, count: int, generator: np.random.Generator
) -> Iterator[Finding]:
    """Perform some labelled attempts of simulated sessions again and compare how they end, and every recorded bit."""
    table = dataset.attempts
    rows = table[table["seed"].notna() & table["recorded_success"].notna() & ~table["excluded"]]
    chosen = rows.index[np.sort(generator.permutation(len(rows))[:count])]
    wrong, different, not_possible, alike = [], [], [], []
    for attempt in chosen:
        _, number = parse_attempt_id(attempt)
        header = dataset.session(attempt).header
        again = resimulate(header, number)
        if again is None:
            not_possible.append(attempt)
        elif again.outcome != Outcome[table.loc[attempt, "outcome"].upper()]:
            wrong.append(attempt)
        elif attempt_digest(again, header.station).hex() != table.loc[attempt, "digest"]:
            different.append(attempt)
        else:
            alike.append(attempt)
    of = f"{{n}} of {counted(len(chosen), 'attempt')}"
    yield from attempt_finding(
        "GD-501", "error", wrong, f"{of} with another outcome when simulated again: other code, assets or seeds"
    )
    yield from attempt_finding(
        "GD-502", "warning", different, f"{of} with the same outcome when simulated again, but other bytes"
    )
    yield from attempt_finding("GD-503", "note", not_possible, f"{of} not possible to simulate again here")
    yield from attempt_finding("GD-504", "note", alike, f"{of} the same in every recorded bit when simulated again")
