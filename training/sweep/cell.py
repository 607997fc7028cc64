"""Cells of a sweep: what each is trained on, and with what."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

from handsight.datasets.inputs.augmentation import Jitter
from handsight.training.errors import SweepPlanError, TrainerSettingsError
from handsight.training.gqn import CHANNEL_SETS
from handsight.training.settings import TrainSettings

ALL = "all"
"""The size of a training set of every attempt that is not held out."""
NO_JITTER = Jitter(brightness=0, colour_noise=0, height_noise_m=0, turn_rad=0, shift=0, flips=False)
_NUMBERS = {"mixup": "mixup", "lr": "learning_rate", "weight-decay": "weight_decay", "average": "average"}
_COUNTS = {"batch": "batch", "epochs": "epochs", "least-epochs": "least_epochs", "patience": "patience"}
VARIED = ("augmentation", "balance", *_NUMBERS, *_COUNTS)
"""Parts of the recipe that a sweep can vary."""
_VALUE = re.compile(r"[A-Za-z0-9.+-]{1,32}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """One training of a sweep."""

    dataset: int
    """Position in the datasets of the plan."""
    channels: str
    size: int | None
    """Attempts to train on; None for all that are not held out."""
    trial: int
    """From 0. Trials of one number hold out the same, whatever else differs."""
    varied: tuple[tuple[str, str], ...] = ()
    """Parts of the recipe that differ from the plan's, by name, as text."""

    @property
    def name(self) -> str:
        """What its folder is called: unique in a sweep."""
        size = ALL if self.size is None else str(self.size)
        parts = [f"{self.channels}-{size}-{self.trial:03d}"]
        parts += [f"data={self.dataset}"] if self.dataset else []
        return "-".join([*parts, *(f"{name}={value}" for name, value in self.varied)])

    def series(self, datasets: Sequence[str] = ()) -> str:
        """What it shares with cells of other sizes and trials: a line of the figure.

        Args:
            datasets: What those of the plan are called, where there are several.
        """
        parts = [self.channels, *([datasets[self.dataset]] if len(datasets) > 1 else [])]
        return " ".join([*parts, *(f"{name}={value}" for name, value in self.varied)])

    def settings(self, recipe: TrainSettings, seed: int) -> TrainSettings:
        """The recipe of this cell.

        Raises:
            TrainerSettingsError: A value is out of range.
        """
        changes = dict(change for name, value in self.varied for change in varied_setting(name, value).items())
        return replace(recipe, network=replace(recipe.network, channels=self.channels), seed=seed, **changes)

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> Self:
        """From what ``dataclasses.asdict`` gave, perhaps by way of a file."""
        return cls(**{**values, "varied": tuple((name, value) for name, value in values["varied"])})


def varied_setting(name: str, value: str) -> dict[str, Any]:
    """A part of the recipe from its name and value as text.

    Raises:
        SweepPlanError: There is no such part, or no such value of it.
    """
    if name in ("augmentation", "balance"):
        if value not in ("on", "off"):
            raise SweepPlanError(f"{name} is {value!r}, expected on or off")
        if name == "balance":
            return {"balance": value == "on"}
        return {} if value == "on" else {"jitter": NO_JITTER}
    known = {**_NUMBERS, **_COUNTS}
    if name not in known:
        raise SweepPlanError(f"there is no {name!r} to vary, expected one of: {', '.join(VARIED)}")
    try:
        number = int(value) if name in _COUNTS else float(value)
    except ValueError:
        raise SweepPlanError(f"{name} is {value!r}, expected a number") from None
    return {known[name]: number}


def axis_faults(
    channels: Sequence[str], sizes: Sequence[int | None], varied: Mapping[str, Sequence[str]], recipe: TrainSettings
) -> list[str]:
    """What is wrong with the axes of a sweep; empty when nothing is."""
    faults = [
        f"channels are {name!r}, expected one of: {', '.join(CHANNEL_SETS)}"
        for name in channels
        if name not in CHANNEL_SETS
    ]
    faults += [f"size is {size}, expected at least 2" for size in sizes if size is not None and size < 2]
    axes: dict[str, Sequence[Any]] = {"channels": channels, "sizes": sizes, **varied}
    for name, values in axes.items():
        if not values:
            faults.append(f"there is no value of {name}, expected at least one")
        elif len(set(values)) < len(values):
            faults.append(f"{name} has a value twice ({', '.join(map(str, values))}), expected each once")
    for name, values in varied.items():
        for value in values:
            try:
                if not _VALUE.fullmatch(value):
                    raise SweepPlanError(f"{name} is {value!r}, expected a short word or number")
                replace(recipe, **varied_setting(name, value))
            except (SweepPlanError, TrainerSettingsError) as error:
                faults.append(str(error))
    return faults
