"""A recipe in a file: the ``settings`` of what ``handsight tune`` found, or of anything that has such."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any, NoReturn

from handsight.datasets.errors import HeaderError
from handsight.datasets.format.typed import typed
from handsight.training.errors import TrainerSettingsError
from handsight.training.settings import TrainSettings

_LARGEST_BYTES = 1 << 20


def read_recipe(path: Path, *, seed: int) -> TrainSettings:
    """The recipe that a file holds, for a network that says how likely a grasp is to succeed.

    A search weighs successes and failures alike, as its test sets do; scores of such networks are no chances, which the
    servo loop takes them for. Here they count as there are.

    Args:
        path: JSON with an object ``settings``, such as ``best.json``.
        seed: Of the training; that of the file was of a trial.

    Raises:
        TrainerSettingsError: It holds no recipe; every fault is named.
        OSError: It cannot be read.
    """
    try:
        settings = _settings(path)
        return replace(typed(TrainSettings, settings, "settings"), balance=False, seed=seed)
    except (ValueError, RecursionError) as error:
        said = str(error) if isinstance(error, HeaderError | TrainerSettingsError) else f"it is no JSON: {error}"
        raise TrainerSettingsError(
            f"{path} holds no recipe ({said}): expected best.json of a search, see 'handsight tune --help'"
        ) from error


def _settings(path: Path) -> Any:
    if (size := path.stat().st_size) > _LARGEST_BYTES:
        raise TrainerSettingsError(f"it has {size} bytes, expected at most {_LARGEST_BYTES}")
    said = json.loads(path.read_bytes().decode(), parse_constant=_refuse)
    if not isinstance(said, dict) or "settings" not in said:
        raise TrainerSettingsError("settings is missing")
    return said["settings"]


def _refuse(name: str) -> NoReturn:
    raise ValueError(f"{name} is no number")
