"""What ``handsight view dataset`` and ``handsight review`` browse: which attempts, and what is known of them."""

from __future__ import annotations

import subprocess
import time
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from handsight.cli.errors import CommandError
from handsight.cli.output import bold, console, errors
from handsight.datasets.address import cache_folder
from handsight.datasets.curation.curator import Curator
from handsight.datasets.errors import counted, pasteable
from handsight.datasets.format.scores import ERROR_PREFIX, SCORE_PREFIX, read_scores, score_names
from handsight.datasets.integrity.doctor.examine import doctor
from handsight.datasets.reading.attempt_ids import resolve_attempt_ids, short_id
from handsight.datasets.reading.listing import Listing, list_attempts
from handsight.datasets.reading.reader import GraspDataset
from handsight.viz.browser.browser import MOST_BYTES, Browser, BrowserSettings
from handsight.viz.browser.decisions import Decided
from handsight.viz.browser.rows import Seen

POLL_S = 0.5
"""How often the browser's table is compared with the version."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Chosen:
    """Attempts in the order in which they are shown, and what is known of them."""

    ids: Sequence[str]
    seen: Seen = field(default_factory=Seen)


def chosen_attempts(
    dataset: GraspDataset,
    attempts: Sequence[str] | None,
    *,
    where: str,
    filter: str,
    suspect: bool = False,
    like: str = "",
    model: Path | None = None,
    sort: str = "",
    reverse: bool = False,
    limit: int = 0,
) -> Chosen:
    """The attempts that are asked for.

    Raises:
        CommandError: There are none.
        ListingError: There is no such column or filter, or an expression is not sound.
        AttemptNotFoundError: A text means no attempt, or more than one.
    """
    if attempts:
        ids = resolve_attempt_ids(dataset, attempts)
    else:
        listing = Listing(where=where, filter=filter, sort=sort, reverse=reverse, columns=(), limit=limit)
        ids = [str(key) for key in list_attempts(dataset, listing).rows.index]
    if not ids:
        total = counted(sum(session.attempts for session in dataset.sessions), "attempt")
        asked = " and ".join(filter for filter in (where, filter and f"the filter {filter}") if filter)
        remedy = f"none matches {asked}: ask for others" if asked else "there is nothing to look at: collect some first"
        raise CommandError(f"{dataset.repository.path}@{dataset.ref} holds {total}, and {remedy}")
    findings = _findings(dataset)
    if like and model is not None:
        from handsight.cli.wiring.similarity import similar_attempts  # PyTorch

        (attempt,) = resolve_attempt_ids(dataset, [like])
        wanted = set(ids)
        found = similar_attempts(dataset, attempt, model)
        return Chosen(ids=[one.attempt for one in found if one.attempt in wanted], seen=Seen(findings=findings))
    if suspect:
        return _by_label_quality(dataset, ids, findings, reverse=reverse)
    return Chosen(ids=ids, seen=Seen(predicted=_scores_named(dataset, sort), findings=findings))


def open_browser(
    dataset: GraspDataset, chosen: Chosen, *, name: str, model: Path | None, author: str, limit_bytes: int = MOST_BYTES
) -> Browser:
    """A browser of attempts; decisions can be taken where the version is a branch."""
    scorer = None
    if model is not None:
        from handsight.training.run import load_scorer  # PyTorch

        scorer = load_scorer(model)
    settings = BrowserSettings(
        cards=cache_folder() / "cards-1", name=name, seen=chosen.seen, scorer=scorer, limit_bytes=limit_bytes
    )
    return Browser(dataset, chosen.ids, settings, curator=curator_of(dataset, author))


def curator_of(dataset: GraspDataset, author: str) -> Curator | None:
    """Who decides about a version; nobody about a release or a snapshot, which do not change."""
    if dataset.ref not in dataset.repository.branches():
        return None
    return Curator(dataset.repository, author=author, branch=dataset.ref)


def watch(browser: Browser, process: subprocess.Popen[bytes], *, quiet: bool) -> None:
    """Take the decisions that are edited in the viewer until it is closed, and say what was decided."""
    while process.poll() is None:
        for decided in browser.decide_edits():
            _say(browser, decided, quiet=quiet)
        browser.follow()
        time.sleep(POLL_S)


def _say(browser: Browser, decided: Decided, *, quiet: bool) -> None:
    short = short_id(browser.dataset)(decided.edit.attempt)
    if decided.refused:
        errors.print(f"{short} stays as it is: {decided.refused}")
    elif decided.decision is not None and not quiet:
        undo = pasteable("handsight", "dataset", "undo", browser.dataset.repository.path, decided.decision.number)
        console.print(bold(short), f": {_act(decided)}; take it back with {undo}")


def _act(decided: Decided) -> str:
    done = {"exclude": "excluded", "restore": "restored", "unlabel": "has its recorded label again"}
    return done.get(decided.edit.act, f"relabelled {decided.edit.label}")


def _findings(dataset: GraspDataset) -> dict[str, list[str]]:
    """Codes of what doctor finds without looking at pictures, by attempt."""
    found: dict[str, list[str]] = defaultdict(list)
    for finding in doctor(dataset).findings:
        for attempt in finding.attempts:
            found[attempt].append(finding.code)
    return dict(found)


def _scores_named(dataset: GraspDataset, column: str) -> dict[str, float]:
    """The stored scores that a column is made of, by attempt; nothing for any other column."""
    name = column.removeprefix(ERROR_PREFIX).removeprefix(SCORE_PREFIX)
    if name == column or name not in score_names(dataset.root):
        return {}
    return {str(key): float(value) for key, value in read_scores(dataset.root, name).score.items()}


def _by_label_quality(
    dataset: GraspDataset, ids: Sequence[str], findings: dict[str, list[str]], *, reverse: bool
) -> Chosen:
    from handsight.cli.wiring.label_review import checked_plan, review_labels  # PyTorch

    plan = checked_plan(dataset, folds="", epochs=10, where="", seed=0, rrd=None)
    _, review = review_labels(dataset, plan, len(plan.listed))
    issues = {issue.attempt: issue for issue in review.issues if issue.attempt in set(ids)}
    if not issues:
        raise CommandError("none of the attempts asked for has a label to doubt, expected some: ask for others")
    seen = Seen(
        predicted={key: issue.predicted_success for key, issue in issues.items()},
        label_quality={key: issue.label_quality for key, issue in issues.items()},
        findings=findings,
    )
    order = list(issues)
    return Chosen(ids=order[::-1] if reverse else order, seen=seen)
