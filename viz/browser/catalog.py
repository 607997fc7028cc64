"""The browser's catalog: a table of attempts with cards, and the recordings that they show and open."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pyarrow as pa
import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint import table as rrt
from rerun.catalog import OnDuplicateSegmentLayer

from handsight.datasets.held import HeldFolder
from handsight.viz.browser.rows import EXCLUDED, INDEX, LABEL, SCHEMA
from handsight.viz.browser.shelf import Kind

KIND = "handsight_browser"
TABLE = "attempts"
_DATASETS: dict[Kind, str] = {"card": "cards", "attempt": "recordings"}
_NAMES = {
    "predicted_success": "predicted S",
    "label_quality": "label quality",
    "force_n": "force [N]",
    "opening_mm": "opening [mm]",
    "started": "started (UTC)",
}
"""What columns are called where their own name would be read with difficulty."""


class Catalog:
    """Rerun's catalog server in this process, on the loopback.

    Args:
        name: What the table is called.
        host: Where to listen.
    """

    def __init__(self, name: str, *, host: str = "127.0.0.1") -> None:
        self._server = rr.server.Server(host=host)
        self._client = self._server.client()
        self._folder = HeldFolder("handsight-browser-")
        self._datasets = {kind: self._client.create_dataset(dataset) for kind, dataset in _DATASETS.items()}
        self._table = self._client.create_table(name, SCHEMA)
        self._said: pa.Table | None = None

    @property
    def port(self) -> int:
        """Where it listens."""
        return int(self._server.url().rpartition(":")[2])

    @property
    def folder(self) -> Path:
        """A folder that ends with the catalog."""
        return self._folder.path

    def table_address(self, port: int) -> str:
        """The address of the table through a port."""
        return f"rerun+http://127.0.0.1:{port}/entry/{self._table.id}"

    def recording_address(self, kind: Kind, recording: str, port: int) -> str:
        """The address of a recording through a port, whether there is one yet or not."""
        return f"rerun+http://127.0.0.1:{port}/dataset/{self._datasets[kind].id}?segment_id={recording}"

    def lay_out(self, card: rrb.View, attempt: rrb.Blueprint, *, editable: bool, known: Sequence[str]) -> None:
        """Say how table, cards and recordings are shown.

        Args:
            card: The view of a card.
            attempt: The layout of the recording that a card opens.
            editable: Whether a person may decide here.
            known: Columns that have something in them; the others are hidden.
        """
        path = self.folder / "attempt.rbl"
        attempt.save("handsight_attempt", str(path))
        self._datasets["attempt"].register_blueprint(path.as_uri())
        path = self.folder / "table.rbl"
        _table_blueprint(card, editable=editable, known=known).save(KIND, str(path))
        self._table.register_blueprint(path.as_uri())

    def fill(self, batch: pa.RecordBatch) -> None:
        """Add rows to the table."""
        self._table.append(batch)

    def write_again(self, batch: pa.RecordBatch) -> None:
        """Replace rows of the table, found by their attempt."""
        self._table.upsert(batch)

    def edited(self) -> list[tuple[str, bool, str]]:
        """What the table says now of each attempt: its id, whether it is excluded, its label.

        Nothing where it says what it said the last time.
        """
        found = self._table.reader().select(INDEX, EXCLUDED, LABEL).to_arrow_table()
        if self._said is not None and found.equals(self._said):
            return []
        self._said = found
        columns = [found.column(name).to_pylist() for name in (INDEX, EXCLUDED, LABEL)]
        return [(str(key), bool(excluded), str(label)) for key, excluded, label in zip(*columns, strict=True)]

    def register(self, kind: Kind, paths: Sequence[Path]) -> None:
        """Make recordings known."""
        uris = [path.resolve().as_uri() for path in paths]
        self._datasets[kind].register(uris, on_duplicate=OnDuplicateSegmentLayer.REPLACE).wait()

    def forget(self, kind: Kind, recordings: Sequence[str]) -> None:
        """Make recordings unknown."""
        self._datasets[kind].unregister(segments_to_drop=list(recordings), layers_to_drop=[]).wait()

    def close(self) -> None:
        """Stop the server, and let go of what it keeps on disk, which goes when nobody asks for it any more."""
        self._server.shutdown()
        del self._table, self._datasets, self._client, self._server
        self._folder.cleanup()


def _table_blueprint(card: rrb.View, *, editable: bool, known: Sequence[str]) -> rrt.TableBlueprint:
    def column(source: str, *, may_edit: bool = False, flag: bool = False) -> rrt.Column:
        return rrt.Column(
            source,
            name=_NAMES.get(source, source),
            editable=(editable and may_edit) or None,
            column_type=rr.components.Flag if flag else None,
            visible=source in known or None,
        )

    shown = [name for name in ("predicted_success", "label_quality", "findings", "curation") if name in known]
    fields = [
        # A flag is drawn in the head of a card, where it can be clicked.
        rrt.Column(EXCLUDED, name="excluded", editable=editable or None, column_type=rr.components.Flag),
        rrt.Column("card", name="picture", column_type=rrt.PreviewCell(card)),
        *(column(name) for name in shown),
    ]
    listed = [
        "target",
        "outcome",
        "predicted_success",
        "label_quality",
        "force_n",
        "opening_mm",
        "findings",
        "curation",
    ]
    columns = [
        rrt.Column("title", name="attempt"),
        column(EXCLUDED, may_edit=True),
        column(LABEL, may_edit=True),
        *(column(name) for name in listed if name in known),
        rrt.Column("card", name="picture", column_type=rrt.PreviewCell(card), visible=False),
        *(column(name) for name in ("started", "session")),
        rrt.Column("open", name="recording"),
        rrt.Column(INDEX, name="id"),
    ]
    return rrt.TableBlueprint(
        table_layout=rrt.TableLayout(columns=columns),
        card_layout=rrt.CardLayout(title="title", link="open", fields=fields),
        default_layout="cards",
    )
