"""A training run on disk: weights, and everything needed to know where they come from."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Self

from safetensors import SafetensorError
from safetensors.torch import load_file, save_file

from handsight import __version__
from handsight.datasets.atomic import atomic_file
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

    def to_json(self) -> dict[str, Any]:
        """As JSON values."""
        return asdict(self)

    @classmethod
    def from_json(cls, values: dict[str, Any]) -> Self:
        """From what :meth:`to_json` gave.

        Raises:
            TypeError: A value is missing, or there is one that this handsight does not know.
        """
        return cls(**values)


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
    record = _record(network, origin, grid, settings, history)
    with atomic_file(folder / RUN_RECORD) as unfinished:
        unfinished.write_text(json.dumps(record, indent=2) + "\n", encoding="utf-8")


def load_run(folder: str | Path) -> TrainedRun:
    """Load a run.

    Raises:
        CheckpointError: The folder is missing, is no run, or is damaged or newer than this handsight.
    """
    folder = Path(folder)
    check_finished_run(folder)
    try:
        record = json.loads((folder / RUN_RECORD).read_text(encoding="utf-8"))
        _check_version(folder, record["run_version"])
        config, origin, grid = _from_record(record)
        network = GraspQualityNetwork(config)
        network.load_state_dict(load_file(folder / WEIGHTS))
    except CheckpointError:
        raise
    except (OSError, KeyError, TypeError, ValueError, RuntimeError, SafetensorError) as error:
        raise CheckpointError(f"{folder} is damaged ({error}): train again, or restore it from a copy") from error
    return TrainedRun(network=network.eval(), origin=origin, grid=grid, record=record)


def load_scorer(folder: str | Path) -> Scorer:
    """The network of a run, ready to score."""
    return load_run(folder).scorer()


def _record(
    network: GraspQualityNetwork,
    origin: DataOrigin,
    grid: InputGrid,
    settings: TrainSettings,
    history: Sequence[Epoch],
) -> dict[str, Any]:
    """``run.json``; what of it a reader needs, :func:`_from_record` takes out again."""
    return {
        "run_version": RUN_VERSION,
        "handsight": __version__,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "origin": origin.to_json(),
        "grid": asdict(grid),
        "settings": {**asdict(settings), "network": settings.network.to_json()},
        "parameters": sum(parameter.numel() for parameter in network.parameters()),
        "history": [asdict(epoch) for epoch in history],
    }


def _from_record(record: dict[str, Any]) -> tuple[GqnConfig, DataOrigin, InputGrid]:
    config = GqnConfig.from_json(record["settings"]["network"])
    return config, DataOrigin.from_json(record["origin"]), InputGrid(**record["grid"])


def _check_version(folder: Path, version: int) -> None:
    if version > RUN_VERSION:
        raise CheckpointError(
            f"{folder} was written by a newer handsight (run version {version}, this one reads up to {RUN_VERSION}): "
            "upgrade handsight"
        )
