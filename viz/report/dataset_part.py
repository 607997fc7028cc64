"""What a report tells of a version of a dataset."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence

from handsight.datasets.errors import counted
from handsight.datasets.format.decisions import Action, Decision
from handsight.datasets.format.sessions import SessionInfo
from handsight.datasets.integrity.doctor.examine import doctor
from handsight.datasets.integrity.doctor.findings import Finding
from handsight.datasets.reading.info import DatasetInfo
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.reading.stats import LabelStats, Share, label_stats
from handsight.evaluation.results import wilson_95
from handsight.training.lineage import runs_trained_on
from handsight.viz.errors import ReportError
from handsight.viz.figures.dataset import stats_figure
from handsight.viz.figures.rate_panels import numbered
from handsight.viz.report.content import Block, Facts, Figure, Note, Section, Table, shown_rows
from handsight.viz.report.embedding import embedded_svg
from handsight.viz.report.gallery import failed_attempts
from handsight.viz.report.words import count, interval, percent, written

MOST_ROWS = 200
"""Of any one table."""
EXAMPLES = 3
"""Attempts that are named for each finding."""


def dataset_section(dataset: GraspDataset, address: str) -> Section:
    """Summary, doctor, labels, curation, lineage and failures of a version.

    Args:
        dataset: The version.
        address: As it was named.

    Raises:
        ReportError: It holds no attempt.
    """
    facts = dataset.info()
    if not facts.attempts:
        raise ReportError(f"{address} holds no attempt, expected some to report on: collect some into it first")
    name = shlex.quote(address)
    parts = [_findings(dataset, name)]
    stats = label_stats(dataset)
    if stats.labelled:
        parts.append(_labels(dataset, stats, name))
    parts.append(_curation(dataset, facts, name))
    if (gallery := failed_attempts(dataset, stats, name)) is not None:
        parts.append(Section(title="Failed attempts", blocks=(gallery,)))
    parts.append(_lineage(dataset, facts, name))
    return Section(title=f"Dataset {address}", blocks=(_summary(facts),), parts=tuple(parts))


def _summary(facts: DatasetInfo) -> Facts:
    labelled = facts.outcomes["held"] + facts.outcomes["empty"]
    share = f", {percent(facts.successes / labelled)} of {count(labelled)} labelled" if labelled else ""
    targeted = sum(number > 0 for number in facts.objects.values())
    return Facts(
        rows=(
            ("version", facts.ref),
            ("attempts", f"{count(facts.attempts)} in {counted(facts.sessions, 'session')}"),
            ("successes", f"{count(facts.successes)}{share}"),
            ("outcomes", ", ".join(f"{count(number)} {name}" for name, number in facts.outcomes.items())),
            ("excluded", count(facts.excluded)),
            ("objects", f"{targeted} targeted of {len(facts.objects)}"),
            ("on disk", f"{facts.bytes / 1e6:.1f} MB with its whole history"),
        )
    )


def _findings(dataset: GraspDataset, name: str) -> Section:
    command = f"handsight dataset doctor {name}"
    found = doctor(dataset).findings
    if not found:
        text = "The doctor has nothing to report: no error, no warning, no note. Pictures were not looked at."
        return Section(title="Doctor", blocks=(Note(text=text, command=command),))
    rows, left = shown_rows(tuple(_finding(one) for one in found), MOST_ROWS)
    tally = [(level, sum(one.severity == level for one in found)) for level in ("error", "warning", "note")]
    table = Table(
        caption=f"{', '.join(counted(number, level) for level, number in tally)}{left}",
        head=("code", "severity", "attempts", "finding", "for instance"),
        rows=rows,
        prose=frozenset({1, 3, 4}),
        command=command,
    )
    return Section(title="Doctor", blocks=(table,))


def _finding(one: Finding) -> tuple[str, ...]:
    more = f" and {len(one.attempts) - EXAMPLES} more" if len(one.attempts) > EXAMPLES else ""
    concerned = count(len(one.attempts)) if one.attempts else "all"
    return one.code, one.severity, concerned, one.message, ", ".join(one.attempts[:EXAMPLES]) + more or "–"


def _labels(dataset: GraspDataset, stats: LabelStats, name: str) -> Section:
    title = f"{str(dataset.repository.path).rpartition('/')[2]}@{dataset.ref}"
    low, high = wilson_95(stats.successes, stats.labelled)
    rate = stats.successes / stats.labelled
    figure = Figure(
        picture=embedded_svg(lambda path: stats_figure(stats, path, title=title)),
        alt=(
            f"Panels of success rates of {title} by object, place on the table, grasp angle, final opening, contact "
            f"force and time. Overall {percent(rate)} of {numbered(stats.labelled, 'labelled attempt')} succeed. "
            "The numbers of the panels by object and session are in the tables below."
        ),
        caption="How grasps succeed by object, place, angle, opening and force, and along the sessions.",
        command=f"handsight dataset stats {name} --plot stats.svg",
    )
    balance = Note(
        text=(
            f"{count(stats.successes)} of {numbered(stats.labelled, 'labelled attempt')} succeed, {percent(rate)} "
            f"(95 % Wilson interval {interval((low, high))}). Left out: {count(stats.unlabelled)} without a label and "
            f"{count(stats.excluded)} excluded."
        )
    )
    tables = [
        _share_table("object", stats.objects, name),
        _share_table("session", stats.sessions, name),
    ]
    return Section(title="Balance of labels", blocks=(balance, figure, *filter(None, tables)))


def _share_table(what: str, shares: Sequence[Share], name: str) -> Table | None:
    ordered = sorted(shares, key=lambda one: (one.rate, one.name))
    rows, left = shown_rows(
        tuple(
            (
                one.name,
                count(one.attempts),
                count(one.successes),
                percent(one.rate),
                interval(wilson_95(one.successes, one.attempts)),
            )
            for one in ordered
            if one.attempts
        ),
        MOST_ROWS,
    )
    if not rows:
        return None
    return Table(
        caption=f"Success by {what}, the lowest first{left}",
        head=(what, "attempts", "successes", "rate", "95 % interval"),
        rows=rows,
        command=f"handsight dataset stats {name}",
        folded=len(rows) > 12,
    )


def _curation(dataset: GraspDataset, facts: DatasetInfo, name: str) -> Section:
    overlay = dataset.overlay
    if not overlay.decisions:
        return Section(title="Curation", blocks=(Note(text="Nothing was decided: every attempt counts as recorded."),))
    rows, left = shown_rows(
        tuple(_decision(one, counts=one.number not in overlay.undone) for one in overlay.decisions), MOST_ROWS
    )
    relabelled = len(overlay.labels)
    blocks: tuple[Block, ...] = (
        Note(
            text=(
                f"{counted(facts.excluded, 'attempt')} excluded and {count(relabelled)} relabelled by "
                f"{counted(len(overlay.decisions), 'decision')}. Nothing is deleted, and every decision can be undone."
            )
        ),
        Table(
            caption=f"Decisions, the oldest first{left}",
            head=("decision", "decided", "what", "attempts", "author", "reason"),
            rows=rows,
            prose=frozenset({1, 2, 4, 5}),
            command=f"handsight dataset decisions {name}",
        ),
    )
    return Section(title="Curation", blocks=blocks)


def _decision(one: Decision, *, counts: bool) -> tuple[str, ...]:
    what = one.action.name.lower()
    if one.action is Action.RELABEL:
        what += " as success" if one.value else " as failure"
    elif one.action is Action.UNDO:
        what += f" decision {one.value}"
    return (
        str(one.number),
        written(one.decided.isoformat()),
        what if counts else f"{what} (undone)",
        count(len(one.attempts)),
        one.author,
        one.reason,
    )


def _lineage(dataset: GraspDataset, facts: DatasetInfo, name: str) -> Section:
    identity = Facts(
        rows=(
            ("snapshot", facts.snapshot),
            ("content digest", facts.digest),
            ("curation digest", facts.curation_digest),
            ("schema", str(facts.schema_version)),
        )
    )
    rows, left = shown_rows(tuple(map(_session, dataset.sessions)), MOST_ROWS)
    blocks: list[Block] = [identity]
    if rows:
        blocks.append(
            Table(
                caption=f"Sessions{left}",
                head=("session", "source", "seed", "attempts", "began", "state", "handsight", "commit", "packages"),
                rows=rows,
                prose=frozenset({1, 4, 5, 6, 7, 8}),
                command=f"handsight dataset info {name} --json",
            )
        )
    blocks += _runs(dataset, name)
    return Section(title="Lineage", blocks=tuple(blocks))


def _session(one: SessionInfo) -> tuple[str, ...]:
    commit = str(one.code.get("commit") or "–")[:12] + (" with changes" if one.code.get("dirty") else "")
    return (
        one.ulid,
        one.header.station.source,
        str(one.header.seed),
        count(one.attempts),
        written(one.started),
        one.status,
        str(one.code.get("version") or "–"),
        commit,
        ", ".join(f"{package} {version}" for package, version in sorted(one.packages.items())),
    )


def _runs(dataset: GraspDataset, name: str) -> Iterator[Block]:
    runs = runs_trained_on(dataset)
    if runs:
        yield Table(
            caption="Runs that were trained on this version",
            head=("run", "created", "weights (SHA-256)", "still there"),
            rows=tuple(
                (one.run, written(one.created), one.weights_sha256[:16], "yes" if one.exists else "no") for one in runs
            ),
            prose=frozenset({1, 2, 3}),
            command=f"handsight dataset info {name}",
        )
