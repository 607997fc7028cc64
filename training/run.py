"""A training run on disk: weights, and everything needed to know where they come from."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from safetensors import SafetensorError
from safetensors.torch import load_file, save_file

from handsight import __version__
from handsight.servoing.homography import InputGrid
from handsight.training.errors import CheckpointError
from handsight.training.gqn import GqnConfig, GraspQualityNetwork, Scorer
from handsight.training.run_folder import RUN_RECORD, check_finished_run, check_run_folder
from handsight.training.trainer import Epoch, TrainSettings

RUN_VERSION = 1
WEIGHTS = "model.safetensors"


@dataclass(frozen=True, slots=True, kw_only=True)
class DataOrigin:
    """What a network was trained on."""

    dataset: str
    """Path of the dataset, as given."""
    ref: str
    snapshot: str
    digest: str
    view: str
    """Which recorded picture was warped to the grasp: ``pregrasp`` or ``overhead``."""
    attempts: int


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainedRun:
    """A trained network with its provenance."""

    network: GraspQualityNetwork
    origin: DataOrigin
    grid: InputGrid
    record: dict[str, Any]
    """The whole ``run.json``."""

    def scorer(self) -> Scorer:
        """The network as the servo loop wants it."""
        return Scorer(self.network)


def save_run(
    folder: Path,
    network: GraspQualityNetwork,
    *,
    origin: DataOrigin,
    grid: InputGrid,
    settings: TrainSettings,
    history: Sequence[Epoch],
) -> None:
    """Write weights and record; the record comes last, so a folder with a record is complete."""
    check_run_folder(folder)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / RUN_RECORD).unlink(missing_ok=True)
    save_file(network.state_dict(), folder / WEIGHTS)
    record = {
        "run_version": RUN_VERSION,
        "handsight": __version__,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "origin": asdict(origin),
        "grid": asdict(grid),
        "settings": asdict(settings),
        "parameters": sum(parameter.numel() for parameter in network.parameters()),
        "history": [asdict(epoch) for epoch in history],
    }
    unfinished = folder / f".{RUN_RECORD}.unfinished"
    unfinished.write_text(json.dumps(record, indent=2) + "\n", encoding="utf-8")
    unfinished.replace(folder / RUN_RECORD)


def load_run(folder: str | Path) -> TrainedRun:
    """Load a run.

    Raises:
        CheckpointError: The folder is missing, is no run, or is damaged or newer than this handsight.
    """
    folder = Path(folder)
    check_finished_run(folder)
    try:
        record = json.loads((folder / RUN_RECORD).read_text(encoding="utf-8"))
        if record["run_version"] > RUN_VERSION:
            raise CheckpointError(
                f"{folder} was written by a newer handsight (run version {record['run_version']}, this one reads up to "
                f"{RUN_VERSION}): upgrade handsight"
            )
        recorded: dict[str, Any] = record["settings"]["network"]
        shape: dict[str, Any] = {name: tuple(v) if isinstance(v, list) else v for name, v in recorded.items()}
        network = GraspQualityNetwork(GqnConfig(**shape))
        network.load_state_dict(load_file(folder / WEIGHTS))
        return TrainedRun(
            network=network.eval(),
            origin=DataOrigin(**record["origin"]),
            grid=InputGrid(**record["grid"]),
            record=record,
        )
    except (OSError, KeyError, TypeError, ValueError, RuntimeError, SafetensorError) as error:
        if isinstance(error, CheckpointError):
            raise
        raise CheckpointError(f"{folder} is damaged ({error}): train again, or restore it from a copy") from error


def load_scorer(folder: str | Path) -> Scorer:
    """The network of a run, ready to score."""
    return load_run(folder).scorer()
