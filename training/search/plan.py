"""The plan of a search: what a recipe is looked for, in which space, and on which trials every proposal is judged.

A folder belongs to one plan. Everything that its proposals and their losses follow from is in ``plan.json``.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from handsight.datasets.atomic import write_text
from handsight.datasets.writable import folder_fault
from handsight.training.errors import SweepFolderError, SweepPlanError
from handsight.training.settings import TrainSettings
from handsight.training.sweep.plan import PLAN, SweepPlan, shown_value

SEARCH_VERSION = 1
_ADDRESSES = ("address", "ref")
"""Of a dataset. Where it lies may change: snapshot and digest say which version it is."""
_DIGITS = 9
"""Decimals of an average: 1 - 0.005 is 0.995 and nothing beside it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Dimension:
    """One number that is looked for."""

    low: float
    high: float
    """Within the range."""
    log: bool = False
    """Whether equal factors count alike, and not equal steps."""
    whole: bool = False


SPACE = {
    "learning_rate": Dimension(low=2e-4, high=2e-2, log=True),
    "weight_decay": Dimension(low=1e-4, high=0.3, log=True),
    "forgetting": Dimension(low=5e-4, high=0.05, log=True),
    "mixup": Dimension(low=0.0, high=1.0),
    "batch": Dimension(low=50, high=500, log=True, whole=True),
    "turn_rad": Dimension(low=0.0, high=0.4),
    "shift": Dimension(low=0.0, high=0.08),
    "brightness": Dimension(low=0.0, high=0.5),
}
"""What is looked for. ``forgetting`` is 1 - ``average``; the last three are parts of the jitter."""


def values_of(recipe: TrainSettings) -> dict[str, float]:
    """Where a recipe lies in the space."""
    jitter = recipe.jitter
    return {
        "learning_rate": recipe.learning_rate,
        "weight_decay": recipe.weight_decay,
        "forgetting": round(1 - recipe.average, _DIGITS),
        "mixup": recipe.mixup,
        "batch": recipe.batch,
        "turn_rad": jitter.turn_rad,
        "shift": jitter.shift,
        "brightness": jitter.brightness,
    }


def recipe_at(values: Mapping[str, float], recipe: TrainSettings) -> TrainSettings:
    """The recipe at some place of the space; what is not looked for is as in ``recipe``."""
    return replace(
        recipe,
        learning_rate=values["learning_rate"],
        weight_decay=values["weight_decay"],
        average=round(1 - values["forgetting"], _DIGITS),
        mixup=values["mixup"],
        batch=int(values["batch"]),
        jitter=replace(
            recipe.jitter, turn_rad=values["turn_rad"], shift=values["shift"], brightness=values["brightness"]
        ),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchPlan:
    """What is looked for, and how."""

    sweep: SweepPlan
    """The trials that judge a proposal: one dataset, channel set and size. Its recipe is the first proposal."""

    def __post_init__(self) -> None:
        sweep = self.sweep
        axes = {"dataset": sweep.datasets, "channel set": sweep.channels, "size": sweep.sizes}
        faults = [f"there are {len(some)} of {name}, expected one" for name, some in axes.items() if len(some) != 1]
        if sweep.varied:
            faults.append(f"{', '.join(sweep.varied)} is varied, expected nothing: a search varies the recipe itself")
        for name, value in values_of(sweep.recipe).items():
            if not SPACE[name].low <= value <= SPACE[name].high:
                faults.append(f"{name} is {value}, expected {SPACE[name].low} to {SPACE[name].high}")
        if faults:
            raise SweepPlanError("; ".join(faults))

    def to_json(self) -> dict[str, Any]:
        """As JSON values."""
        space = {name: asdict(dimension) for name, dimension in SPACE.items()}
        return {"search_version": SEARCH_VERSION, **self.sweep.to_json(), "space": space}


def settle_search(folder: Path, plan: SearchPlan, *, dry_run: bool = False) -> None:
    """Make a folder the plan's, or see that it is.

    Raises:
        SweepFolderError: Something else is in the folder, it cannot be written to, or its plan is damaged.
        SweepPlanError: The folder is of another plan; every difference is named.
    """
    if (fault := folder_fault(folder)) is not None:
        raise SweepFolderError(f"no search can be written to {folder}: {fault}; choose another --out")
    if (folder / PLAN).is_file():
        faults = plan_differences(_read(folder / PLAN), plan.to_json())
        if faults:
            raise SweepPlanError(f"the folder is of another plan: {'; '.join(faults)}: begin in a new folder")
        return
    if folder.is_dir() and any(not path.name.startswith(".") for path in folder.iterdir()):
        raise SweepFolderError(f"{folder} holds other files, expected a new or empty folder: choose another --out")
    if not dry_run:
        folder.mkdir(parents=True, exist_ok=True)
        write_text(folder / PLAN, json.dumps(plan.to_json(), indent=2) + "\n", durable=True)


def plan_differences(was: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    """In what two plans differ, part by part; empty when they are equal."""
    before, after = _flat(was), _flat(now)
    return [
        f"{name} {shown_value(before.get(name))}, now {shown_value(after.get(name))}"
        for name in {**before, **after}
        if before.get(name) != after.get(name)
    ]


def _read(path: Path) -> dict[str, Any]:
    try:
        values = json.loads(path.read_bytes().decode())
        if not isinstance(values, dict):
            raise TypeError(f"it is a {type(values).__name__}, expected an object")
    except (ValueError, TypeError, RecursionError) as error:
        raise SweepFolderError(
            f"{path} is damaged ({error}): restore it from a copy, or begin in a new folder"
        ) from error
    version = values.get("search_version")
    if version is None:
        raise SweepFolderError(f"{path.parent} is the folder of a sweep, not of a search: choose another --out")
    if isinstance(version, int) and version > SEARCH_VERSION:
        raise SweepFolderError(
            f"{path} was written by a newer handsight (search version {version}, this one reads up to "
            f"{SEARCH_VERSION}): upgrade handsight"
        )
    return values


def _flat(value: Any, name: str = "") -> dict[str, Any]:
    """Every leaf by its path; lists of plain values are leaves."""
    if isinstance(value, list) and any(isinstance(one, dict) for one in value):
        value = {str(at): one for at, one in enumerate(value)}
    if not isinstance(value, Mapping):
        return {name: value}
    leaves: dict[str, Any] = {}
    for part, one in value.items():
        path = f"{name}.{part}" if name else part
        if not (name.startswith("datasets.") and part in _ADDRESSES):
            leaves |= _flat(one, path)
    return leaves
