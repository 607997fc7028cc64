"""The folder of a sweep: which cells are done, failed, or being trained by somebody, and what became of them.

::

    plan.json
    cells/<name>/           config.json, curve.csv, predictions.csv, metrics.json (written last: a cell that has it
                            is done), failure.json where it failed, checkpoint.ckpt while it is trained
    cells/<name>.lock       held by the process that has it trained

Any number of processes can share a folder. A cell is taken by a lock that its process holds for as long as it lives.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, Literal

from handsight.datasets.atomic import clear_unfinished, write_text
from handsight.datasets.held import HeldFile, is_held, lock_of, remove_abandoned
from handsight.training.errors import SweepFolderError
from handsight.training.run_folder import CHECKPOINT
from handsight.training.sweep.cell import Cell
from handsight.training.sweep.result import CellResult, curve_csv, predictions_csv

CELLS = "cells"
CONFIG = "config.json"
CURVE = "curve.csv"
PREDICTIONS = "predictions.csv"
METRICS = "metrics.json"
FAILURE = "failure.json"

CellState = Literal["done", "failed", "running", "left"]


class SweepFolder:
    """The cells of a sweep on disk.

    Args:
        path: The folder; it is made where it is missing.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    def cell_folder(self, cell: Cell) -> Path:
        """Where a cell is kept."""
        return self.path / CELLS / cell.name

    def checkpoint(self, cell: Cell) -> Path:
        """Where a cell is kept while it is trained."""
        return self.cell_folder(cell) / CHECKPOINT

    def state(self, cell: Cell) -> CellState:
        """What a cell has come to."""
        folder = self.cell_folder(cell)
        if (folder / METRICS).is_file():
            return "done"
        lock = lock_of(folder)
        if lock.exists() and is_held(lock):
            return "running"
        return "failed" if (folder / FAILURE).is_file() else "left"

    def claim(self, cell: Cell) -> HeldFile | None:
        """Take a cell that nobody has and that is not done; None where somebody was first."""
        folder = self.cell_folder(cell)
        folder.mkdir(parents=True, exist_ok=True)
        lock = lock_of(folder)
        if lock.exists() and not remove_abandoned(lock):
            return None
        try:
            held = HeldFile(lock)
        except FileExistsError:
            return None
        if (folder / METRICS).is_file():  # finished by another between the look and the lock
            held.release()
            return None
        clear_unfinished(folder)
        return held

    def tidy(self, cell: Cell) -> None:
        """Take away what a process that was killed just after a cell was done has left beside its metrics."""
        lock = lock_of(self.cell_folder(cell))
        if lock.exists() and not remove_abandoned(lock):
            return  # it is at it
        clear_unfinished(self.cell_folder(cell))
        (self.cell_folder(cell) / FAILURE).unlink(missing_ok=True)
        self.checkpoint(cell).unlink(missing_ok=True)

    def write_config(self, cell: Cell, config: Mapping[str, Any]) -> None:
        """Say what is trained, before it is."""
        _write_json(self.cell_folder(cell) / CONFIG, {"cell": asdict(cell), **config})

    def write_result(self, cell: Cell, result: CellResult) -> None:
        """Keep what a cell came to; from the moment its metrics are there, it is done."""
        folder = self.cell_folder(cell)
        for name, text in ((CURVE, curve_csv(result.curve)), (PREDICTIONS, predictions_csv(result.predictions))):
            write_text(folder / name, text)
        _write_json(folder / METRICS, {"cell": asdict(cell), "result": result.to_json()}, durable=True)
        (folder / FAILURE).unlink(missing_ok=True)
        self.checkpoint(cell).unlink(missing_ok=True)

    def write_failure(self, cell: Cell, error: BaseException, trace: str = "") -> None:
        """Keep why a cell failed."""
        said = {"cell": asdict(cell), "error": type(error).__name__, "message": str(error), "trace": trace}
        _write_json(self.cell_folder(cell) / FAILURE, said)

    def forget_failure(self, cell: Cell, *, restart: bool) -> None:
        """Let a failed cell be trained again, from its checkpoint or from the beginning."""
        (self.cell_folder(cell) / FAILURE).unlink(missing_ok=True)
        if restart:
            self.checkpoint(cell).unlink(missing_ok=True)

    def failure(self, cell: Cell) -> str:
        """Why a failed cell failed."""
        try:
            said = json.loads((self.cell_folder(cell) / FAILURE).read_bytes())
            return f"{said['error']}: {said['message']}"
        except (OSError, ValueError, KeyError, TypeError) as error:
            return f"its {FAILURE} cannot be read ({error})"

    def results(self, cells: Iterable[Cell]) -> dict[Cell, CellResult]:
        """What those that are done came to, in their order.

        Raises:
            SweepFolderError: Metrics are damaged, or those of another cell.
        """
        return {cell: self._result(cell) for cell in cells if (self.cell_folder(cell) / METRICS).is_file()}

    def _result(self, cell: Cell) -> CellResult:
        path = self.cell_folder(cell) / METRICS
        try:
            said = json.loads(path.read_bytes())
            found = Cell.from_json(said["cell"])
            result = CellResult.from_json(said["result"])
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise _damaged(path, f"{type(error).__name__}: {error}") from error
        if found != cell:
            raise _damaged(path, f"it is of cell {found.name}")
        return result


def _write_json(path: Path, value: Mapping[str, Any], *, durable: bool = False) -> None:
    write_text(path, json.dumps(value, indent=2) + "\n", durable=durable)


def _damaged(path: Path, fault: str) -> SweepFolderError:
    return SweepFolderError(f"{path} is damaged ({fault}): delete its folder, and the same call trains the cell again")
