"""A dataset as cards in the Rerun viewer, and the decisions that are taken there."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Self

import pyarrow as pa

from handsight.datasets.curation.curator import Curator
from handsight.datasets.errors import counted
from handsight.datasets.reading.attempt_ids import short_id
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.views import grasp_plane_m, station_view
from handsight.servoing.heatmap import Heatmap, grasp_heatmap
from handsight.servoing.scorer import GraspScorer
from handsight.viz.browser.card import card_view, write_card
from handsight.viz.browser.catalog import TABLE, Catalog
from handsight.viz.browser.decisions import Decided, Edit, Row, decide, edits_between
from handsight.viz.browser.gateway import Gateway
from handsight.viz.browser.rows import BrowserRow, Seen, browser_rows, table_batch
from handsight.viz.browser.shelf import Shelf, Wanted, recording_id
from handsight.viz.errors import BrowserError
from handsight.viz.recordings.attempt import AttemptExample, attempt_blueprint, pregrasp_pose, write_attempt

MOST_BYTES = 1_000_000_000
"""Of recordings on disk, unless another limit is given."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BrowserSettings:
    """How a browser works."""

    cards: Path
    """Where thumbnails are kept from one call to the next."""
    name: str = ""
    """The dataset as commands name it; empty for its path."""
    limit_bytes: int = MOST_BYTES
    host: str = "127.0.0.1"
    port: int = 0
    """Where the viewer finds the browser; 0 for any free port."""
    seen: Seen = field(default_factory=Seen)
    scorer: GraspScorer | None = None
    """Draws heatmaps into the recordings of attempts; None draws none."""


class Browser:
    """Serves some attempts of a version to viewers on this machine.

    Args:
        dataset: The version.
        ids: The attempts, in the order in which they are shown.
        settings: See there.
        curator: Takes the decisions; None where nothing can be decided, as about a release.

    Raises:
        BrowserError: None of the attempts took a picture, or the port is in use.
    """

    def __init__(
        self, dataset: GraspDataset, ids: Sequence[str], settings: BrowserSettings, *, curator: Curator | None
    ) -> None:
        self._dataset = dataset
        self._settings = settings
        self._curator = curator
        self._rows = browser_rows(dataset, ids)
        first = self._first_with_picture()
        self._counts = _counts(self._rows)
        self._catalog = Catalog(TABLE)
        try:
            self._shelf = Shelf(
                cards=settings.cards,
                attempts=self._catalog.folder / "attempts",
                label_of={key: row.label for key, row in self._counts.items()},
                make=self._make,
                register=self._catalog.register,
                forget=self._catalog.forget,
                limit_bytes=settings.limit_bytes,
            )
            self._gateway = _gateway(self._catalog.port, self._shelf, settings)
        except BaseException:
            self._catalog.close()
            raise
        self._lay_out(first)
        self._catalog.fill(self._batch(self._rows))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def address(self) -> str:
        """What a viewer opens to see the cards."""
        return self._catalog.table_address(self._gateway.port)

    @property
    def dataset(self) -> GraspDataset:
        """The version that is shown now: decisions move it."""
        return self._dataset

    @property
    def port(self) -> int:
        """Where the viewer finds the browser."""
        return self._gateway.port

    @property
    def bytes_kept(self) -> int:
        """What the recordings take on disk."""
        return self._shelf.bytes_kept

    @property
    def recordings_made(self) -> int:
        """How many recordings were made for what was looked at."""
        return self._shelf.made

    @property
    def ids(self) -> list[str]:
        """The attempts, in the order in which they are shown."""
        return list(self._rows)

    def provide(self, wanted: Iterable[Wanted]) -> None:
        """Make recordings before a viewer asks for them."""
        self._shelf.provide(wanted)

    def attempt_address(self, attempt: str) -> str:
        """What a viewer opens to see one attempt."""
        return self._catalog.recording_address("attempt", recording_id("attempt", attempt), self._gateway.port)

    def failures(self) -> list[tuple[str, str]]:
        """Attempts that could not be shown, and why."""
        return [(wanted.attempt, str(error)) for wanted, error in self._shelf.failed.items()]

    def decide_edits(self) -> list[Decided]:
        """Take the decisions that were edited in the viewer since the last call.

        What cannot be decided is put back in the table as it counts.
        """
        edits, senseless = edits_between(self._counts, self._catalog.edited())
        edits, stale = _one_each(edits)
        if self._curator is None:
            decided = [Decided(edit=edit, decision=None, refused="a release does not change") for edit in edits]
        else:
            decided = decide(self._curator, edits)
        touched = [*(edit.attempt for edit in edits), *senseless, *stale]
        if touched:
            self._follow(list(dict.fromkeys(touched)))
        return decided

    def follow(self) -> list[str]:
        """Show what others have decided meanwhile; returns the attempts concerned."""
        if self._curator is None or self._curator.repository.version(self._dataset.ref)[0] == self._dataset.snapshot_id:
            return []
        return self._follow(())

    def close(self) -> None:
        """Serve no more."""
        self._gateway.close()
        self._catalog.close()

    def _follow(self, touched: Iterable[str]) -> list[str]:
        """Read the version anew, and write again the rows that differ from it, or whose cells were touched."""
        if self._curator is not None:
            self._dataset = GraspDataset(self._dataset.repository, ref=self._dataset.ref)
            self._rows = browser_rows(self._dataset, self.ids)
        counts = _counts(self._rows)
        changed = [key for key, row in counts.items() if row != self._counts[key]]
        again = list(dict.fromkeys((*changed, *touched)))
        self._counts = counts
        if again:
            self._shelf.decided({key: counts[key].label for key in again})
            self._catalog.write_again(self._batch({key: self._rows[key] for key in again}))
        return changed

    def _first_with_picture(self) -> str:
        for key, row in self._rows.items():
            if row.overhead_taken:
                return key
        raise BrowserError(
            f"of {counted(len(self._rows), 'attempt')} none took a picture, expected one at least: choose others"
        )

    def _lay_out(self, first: str) -> None:
        station, attempt = self._dataset.station(first), self._dataset.attempt(first)
        assert attempt.overhead is not None  # It is one that took a picture.
        rows, seen = self._rows.values(), self._settings.seen
        filled = {
            "predicted_success": bool(seen.predicted) or any(math.isfinite(row.predicted_success) for row in rows),
            "label_quality": bool(seen.label_quality),
            "findings": any(key in seen.findings for key in self._counts),
            "curation": any(row.curation for row in rows),
        }
        known = ["target", "outcome", "force_n", "opening_mm", *(name for name, there in filled.items() if there)]
        layout = attempt_blueprint(station, attempt.overhead)
        self._catalog.lay_out(card_view(station), layout, editable=self._curator is not None, known=known)

    def _batch(self, rows: Mapping[str, BrowserRow]) -> pa.RecordBatch:
        port, address = self._gateway.port, self._catalog.recording_address
        return table_batch(
            rows,
            self._settings.seen,
            card={key: address("card", recording_id("card", key), port) for key in rows},
            opened={key: address("attempt", recording_id("attempt", key), port) for key in rows},
        )

    def _commands(self, attempt: str) -> tuple[str, ...]:
        """What to type to decide about an attempt; nothing where nothing can be decided."""
        if self._curator is None:
            return ()
        name = self._settings.name or f"{self._dataset.repository.path}@{self._dataset.ref}"
        short = short_id(self._dataset)(attempt)
        calls = (("exclude", name, short), ("relabel", name, short, "--to", "failure"))
        return tuple(shlex.join(("handsight", "dataset", *call, "-m", "why")) for call in calls)

    def _make(self, wanted: Wanted, path: Path) -> None:
        """Write a recording; called from the gateway's threads, one at a time."""
        row, station = self._rows[wanted.attempt], self._dataset.station(wanted.attempt)
        name = recording_id(wanted.kind, wanted.attempt)
        if wanted.kind == "card":  # Of tens at a time: only what it shows is read.
            goal = pregrasp_pose(row.pregrasp_x_m, row.pregrasp_y_m, row.pregrasp_angle_rad)
            write_card(path, name, self._dataset.frame(wanted.attempt), goal, station, success=row.success)
            return
        attempt = self._dataset.attempt(wanted.attempt)
        heatmap: Heatmap | None = None
        scorer = self._settings.scorer
        if scorer is not None and attempt.overhead is not None:
            view = station_view(attempt.overhead, station)
            plane_m = grasp_plane_m(view, attempt.overhead, station)
            heatmap = grasp_heatmap(view, scorer, view_plane_m=plane_m)
        example = AttemptExample(
            name=name,
            title=row.title,
            attempt=attempt,
            station=station,
            success=row.success,
            notes=tuple(self._notes(wanted.attempt, row).items()),
            commands=self._commands(wanted.attempt),
            heatmap=heatmap,
            grid=None if scorer is None else scorer.grid,
        )
        write_attempt(path, example)

    def _notes(self, attempt: str, row: BrowserRow) -> Mapping[str, str]:
        seen = self._settings.seen
        predicted = seen.predicted.get(attempt, row.predicted_success)
        notes = {"curation": row.curation or "nothing decided"}
        if math.isfinite(predicted):
            notes["predicted success S"] = f"{predicted:.3f}"
        if attempt in seen.label_quality:
            notes["label quality"] = f"{seen.label_quality[attempt]:.3f}"
        if attempt in seen.findings:
            notes["doctor"] = " ".join(seen.findings[attempt])
        return notes


def _gateway(upstream: int, shelf: Shelf, settings: BrowserSettings) -> Gateway:
    try:
        return Gateway(upstream, shelf.ready, host=settings.host, port=settings.port)
    except OSError as error:
        raise BrowserError(
            f"cannot listen at {settings.host}:{settings.port} ({error.strerror or error}), expected a free port: "
            "choose another, or none for any"
        ) from error


def _counts(rows: Mapping[str, BrowserRow]) -> dict[str, Row]:
    """What counts of the attempts, by id."""
    return {key: Row(excluded=row.excluded, label=row.label) for key, row in rows.items()}


def _one_each(edits: Sequence[Edit]) -> tuple[list[Edit], list[str]]:
    """One edit of each attempt, and the attempts of which there were two.

    A person edits one cell at a time. A label that differs beside a flag that was clicked comes from a viewer whose row
    is older than the last decision.
    """
    first: dict[str, Edit] = {}
    stale = []
    for edit in edits:
        if edit.attempt in first:
            stale.append(edit.attempt)
        else:
            first[edit.attempt] = edit
    return list(first.values()), stale
