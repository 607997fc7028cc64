"""Features of a version's attempts by a trained network, for whatever compares them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handsight.cli.errors import CommandError
from handsight.cli.output import progress_bar
from handsight.datasets.inputs.materialize import materialize, usable_attempts
from handsight.datasets.inputs.viewpoint import DEFAULT_VIEWPOINT
from handsight.datasets.reading.reader import GraspDataset
from handsight.evaluation.similarity import SimilarAttempt, most_similar
from handsight.training.features import network_features
from handsight.training.run import load_run


def attempt_features(dataset: GraspDataset, model: Path) -> tuple[NDArray[np.float32], list[str]]:
    """Features of all attempts that can be trained on, and their ids."""
    run = load_run(model)
    with progress_bar("warp", len(usable_attempts(dataset, DEFAULT_VIEWPOINT))) as bar:
        data = materialize(dataset, viewpoint=DEFAULT_VIEWPOINT, grid=run.grid, on_attempt=bar.advance)
    features = network_features(run.network, data.inputs, np.arange(len(data.attempts)))
    return features, [str(key) for key in data.attempts.index]


def similar_attempts(dataset: GraspDataset, attempt: str, model: Path) -> list[SimilarAttempt]:
    """All attempts that can be trained on, by their likeness to one of them.

    Raises:
        CommandError: The one asked about cannot be trained on: it has no label, or is excluded.
    """
    features, ids = attempt_features(dataset, model)
    if attempt not in ids:
        raise CommandError(
            f"attempt {attempt} has no label that counts, and networks see only those that have: choose another"
        )
    return most_similar(features, ids, attempt)
