"""What a search found: its proposals, the best first, each against the recipe that it began with."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from handsight.datasets.atomic import write_text
from handsight.training.intervals import MeanOverTrials, mean_over_trials
from handsight.training.search.plan import SPACE, SearchPlan, recipe_at
from handsight.training.search.run import loss_of, proposal_folder
from handsight.training.search.study import Proposal, ProposalState, SearchStudy
from handsight.training.settings import TrainSettings
from handsight.training.sweep.result import CellResult

BEST = "best.json"
TABLE = "proposals.csv"
_ORDER: tuple[ProposalState, ...] = ("done", "pruned", "running", "left", "failed")


@dataclass(frozen=True, slots=True, kw_only=True)
class ProposalRow:
    """A proposal, and how good its networks are on objects that they never saw."""

    number: int
    """0 is the recipe that the search began with."""
    state: ProposalState
    trials: int
    """That have been judged."""
    loss: float | None
    """Mean cross-entropy over these trials; None without any."""
    accuracy: float | None
    """Balanced, at S > 0.5; its mean."""
    auc: float | None
    difference: MeanOverTrials | None
    """Loss less that of proposal 0, trial by trial: below 0 is better. None of 0 itself, and without common trials."""
    values: dict[str, float]
    recipe: TrainSettings
    why: str
    """What was wrong where it failed; else empty."""


def proposal_rows(plan: SearchPlan, folder: Path) -> list[ProposalRow]:
    """All proposals of a folder: those that are done by their loss, then the others.

    Raises:
        MissingExtraError: Optuna is not installed.
        SweepFolderError: The journal, or what is kept of a cell, is damaged.
    """
    cells = list(plan.sweep.cells())
    rows: list[ProposalRow] = []
    first: dict[int, CellResult] = {}
    for proposal in SearchStudy(folder, plan).proposals():
        recipe = recipe_at(proposal.values, plan.sweep.recipe)
        kept = proposal_folder(folder, proposal, recipe)
        results = {cell.trial: result for cell, result in kept.results(cells).items()}
        failures = [kept.failure(cell) for cell in cells if proposal.state == "failed" and kept.state(cell) == "failed"]
        first = results if proposal.number == 0 else first
        rows.append(_row(proposal, recipe, results, first, "; ".join(failures[:1])))
    return sorted(rows, key=lambda row: (_ORDER.index(row.state), row.loss or 0.0, row.number))


def best_row(rows: Sequence[ProposalRow]) -> ProposalRow | None:
    """That with the lowest loss over all trials; None while none is done."""
    return next((row for row in rows if row.state == "done"), None)


def write_search(plan: SearchPlan, folder: Path, rows: Sequence[ProposalRow]) -> None:
    """Write ``proposals.csv``, and ``best.json`` once a proposal is done.

    Raises:
        OSError: They cannot be written.
    """
    write_text(folder / TABLE, _csv(rows))
    if (best := best_row(rows)) is not None:
        found = {**row_json(best), "datasets": [asdict(one) for one in plan.sweep.datasets]}
        write_text(folder / BEST, json.dumps({**found, "handsight": plan.sweep.handsight}, indent=2) + "\n")


def row_json(row: ProposalRow) -> dict[str, Any]:
    """A row as JSON values, with the whole recipe as ``settings``."""
    values = asdict(row)
    recipe = values.pop("recipe")
    return {**values, "settings": {**recipe, "network": row.recipe.network.to_json()}}


def _row(
    proposal: Proposal, recipe: TrainSettings, results: dict[int, CellResult], first: dict[int, CellResult], why: str
) -> ProposalRow:
    some = list(results.values())
    common = sorted(results.keys() & first.keys()) if proposal.number else []
    shares = [first[trial].held_out_attempts / (first[trial].held_out_attempts + first[trial].pool) for trial in common]
    differences = [loss_of(results[trial]) - loss_of(first[trial]) for trial in common]
    return ProposalRow(
        number=proposal.number,
        state=proposal.state,
        trials=len(some),
        loss=_mean([loss_of(result) for result in some]),
        accuracy=_mean([result.tested.accuracy or 0.0 for result in some]),
        auc=_mean([result.tested.auc or 0.0 for result in some]),
        difference=mean_over_trials(differences, held_out=sum(shares) / len(shares)) if common else None,
        values=proposal.values,
        recipe=recipe,
        why=why,
    )


def _mean(values: Sequence[float]) -> float | None:
    return sum(values) / len(values) if values else None


def _csv(rows: Sequence[ProposalRow]) -> str:
    text = io.StringIO()
    numbers = ("proposal", "state", "trials", "loss", "accuracy", "auc")
    against = ("difference", "difference_low", "difference_high", "p")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow((*numbers, *against, *SPACE, "why"))
    for row in rows:
        found = row.difference
        paired = (None,) * 4 if found is None else (found.mean, found.low, found.high, found.p)
        values = [row.values[name] for name in SPACE]
        writer.writerow((row.number, row.state, row.trials, row.loss, row.accuracy, row.auc, *paired, *values, row.why))
    return text.getvalue()
