"""How training goes, as event files for TensorBoard, which is an extra: ``pip install 'handsight[tensorboard]'``."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from handsight.training.errors import MissingExtraError
from handsight.training.run_folder import EVENTS

if TYPE_CHECKING:
    from torch.utils.tensorboard import SummaryWriter

    from handsight.training.course import Epoch

INSTALL = "pip install 'handsight[tensorboard]'"


def check_tensorboard() -> None:
    """Refuse where TensorBoard is not installed, without importing it.

    Raises:
        MissingExtraError: It is not.
    """
    if find_spec("tensorboard") is None:
        raise MissingExtraError(f"event files need TensorBoard, which is not installed: {INSTALL}, or train without")


class EventFiles:
    """Curves of one training. Nothing is written before the first pass ends."""

    def __init__(self, run: Path) -> None:
        self._folder = run / EVENTS / f"{datetime.now(UTC):%Y-%m-%dT%H-%M-%S}"
        self._writer: SummaryWriter | None = None

    def add(self, epoch: Epoch) -> None:
        """Write the figures of a pass, so that who watches sees them now.

        Raises:
            OSError: The disk is full or not writable.
        """
        if self._writer is None:
            from torch.utils.tensorboard import SummaryWriter  # with the first pass

            self._writer = SummaryWriter(str(self._folder))
        held_out = epoch.held_out
        curves = {
            "loss/train": epoch.train_loss,
            "loss/held_out": held_out.loss,
            "held_out/auc": held_out.auc,
            "held_out/balanced_accuracy": held_out.accuracy,
        }
        for name, value in curves.items():
            if value is not None:
                self._writer.add_scalar(name, value, epoch.number)
        self._writer.flush()

    def close(self) -> None:
        """Close what is open."""
        if self._writer is not None:
            self._writer.close()


@contextmanager
def event_files(run: Path, *, wanted: bool) -> Iterator[EventFiles | None]:
    """Event files for one training, in a folder of their own below that of the run; None where they are not wanted.

    A run may be trained again, and a training may fail, so that one folder for all would mix their curves.

    Raises:
        MissingExtraError: TensorBoard is not installed.
    """
    if not wanted:
        yield None
        return
    check_tensorboard()
    files = EventFiles(run)
    try:
        yield files
    finally:
        files.close()
