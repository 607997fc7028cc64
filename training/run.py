"""A training run on disk: weights, and everything needed to know where they come from."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Self

from handsight import __version__
from handsight.datasets.atomic import atomic_file
from handsight.servoing.homography import InputGrid
from handsight.training.card import remove_card, write_card
from handsight.training.course import Epoch
from handsight.training.errors import NetworkSettingsError
from handsight.training.gqn import GraspQualityNetwork
from handsight.training.precision import Precision
from handsight.training.run_folder import (
    NEXT_WEIGHTS,
    RUN_RECORD,
    WEIGHTS,
    check_finished_run,
    check_run_folder,
    remove_unfinished,
)
from handsight.training.run_record import RUN_VERSION, TWINS_TOGETHER, WEIGHTS_SHA256, origins_of, read_record, sealed
from handsight.training.scorer import Scorer
from handsight.training.settings import TrainSettings
from handsight.training.weights import read_weights, write_next_weights


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
    origins: tuple[DataOrigin, ...]
    """One for each version and picture; there is at least one."""
    grid: InputGrid
    weights_sha256: str
    """Of the file of weights: which network it is, whatever its folder is called."""
    record: dict[str, Any]
    """The whole ``run.json``."""

    def scorer(self, *, precision: Precision = "float32") -> Scorer:
        """The network as the servo loop wants it.

        Raises:
            NetworkSettingsError: There is no such precision.
        """
        return Scorer(self.network, self.grid, precision=precision)


def save_run(
    folder: Path,
    network: GraspQualityNetwork,
    *,
    origins: Sequence[DataOrigin],
    grid: InputGrid,
    settings: TrainSettings,
    history: Sequence[Epoch] = (),
    kept_epoch: int | None = None,
    selection: Mapping[str, Any] | None = None,
    overwrite: bool = False,
) -> None:
    """Write weights, record and card, so that at any moment the folder holds the old run or the new one, whole.

    The weights are written under another name, and then the record, which names them by their hash: from there on the
    folder holds the new run. Then the weights take their usual name. A card is never beside the record of another
    run: where there is an old run, its card goes first and the new one comes last, and else the card is there before
    the record is.

    Args:
        folder: Where to; made where it is missing.
        network: What was trained.
        origins: What it was trained on; at least one.
        grid: Crop and size of its inputs.
        settings: How it was trained.
        history: How the training went.
        kept_epoch: After which pass the network was kept.
        selection: Which attempts of these were used, as :class:`~.data_selection.DataSelection` says it; None for all.
        overwrite: Whether to replace a run that is there.

    Raises:
        CheckpointError: The folder holds a run, and ``overwrite`` is not set; or other things.
        NetworkSettingsError: The network is not that of the settings, or reads inputs of another size.
        ValueError: There is no origin.
        OSError: The disk is full or not writable.
    """
    check_run_folder(folder, overwrite=overwrite, resume=True)
    if not origins:
        raise ValueError("there is no origin, expected one for each version that the network was trained on")
    if network.config != settings.network or network.config.size_px != grid.size_px:
        raise NetworkSettingsError(
            f"the network is {network.config}, the settings have {settings.network} and inputs {grid.size_px} px, "
            "expected that they agree"
        )
    folder.mkdir(parents=True, exist_ok=True)
    weights_sha256 = write_next_weights(folder, network)
    record = sealed(
        {
            **_record(network, origins, grid, settings),
            **_progress(history, kept_epoch),
            **({} if selection is None else {"selection": dict(selection)}),
            WEIGHTS_SHA256: weights_sha256,
        },
    )
    replaces = (folder / RUN_RECORD).is_file()
    remove_card(folder)
    if not replaces:
        write_card(folder, record)
    with atomic_file(folder / RUN_RECORD, durable=True) as unfinished:
        unfinished.write_text(json.dumps(record, indent=2, allow_nan=False) + "\n", encoding="utf-8")
    (folder / NEXT_WEIGHTS).replace(folder / WEIGHTS)
    if replaces:
        write_card(folder, record)
    remove_unfinished(folder)


def load_run(folder: str | Path) -> TrainedRun:
    """Load a run.

    Raises:
        CheckpointError: The folder is missing, is no run, or is newer than this handsight; or its files are damaged,
            or not of one run.
        OSError: A file cannot be read.
    """
    folder = Path(folder)
    check_finished_run(folder)
    record, config, grid = read_record(folder / RUN_RECORD)
    tensors, weights_sha256 = read_weights(folder, config, record.get(WEIGHTS_SHA256))
    network = GraspQualityNetwork(config)
    network.load_state_dict(tensors)
    return TrainedRun(
        # Nobody trains it further, and a gradient that is asked for its inputs need not be computed for its weights.
        network=network.eval().requires_grad_(False),
        origins=tuple(DataOrigin.from_json(origin) for origin in origins_of(record)),
        grid=grid,
        weights_sha256=weights_sha256,
        record=record,
    )


def load_scorer(folder: str | Path, *, precision: Precision = "float32") -> Scorer:
    """The network of a run, ready to score.

    Raises:
        CheckpointError: As for :func:`load_run`.
        NetworkSettingsError: There is no such precision.
        OSError: A file cannot be read.
    """
    return load_run(folder).scorer(precision=precision)


def _record(
    network: GraspQualityNetwork, origins: Sequence[DataOrigin], grid: InputGrid, settings: TrainSettings
) -> dict[str, Any]:
    """``run.json`` but for how the training went, and its hashes."""
    return {
        "run_version": RUN_VERSION,
        "handsight": __version__,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "origins": [origin.to_json() for origin in origins],
        "grid": grid.to_json(),
        "settings": {**asdict(settings), "network": settings.network.to_json()},
        TWINS_TOGETHER: True,
        "parameters": sum(parameter.numel() for parameter in network.parameters()),
    }


def _progress(history: Sequence[Epoch], kept_epoch: int | None) -> dict[str, Any]:
    return {"history": [asdict(epoch) for epoch in history], "kept_epoch": kept_epoch}
