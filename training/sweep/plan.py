"""The plan of a sweep: everything that its cells follow from, as ``plan.json`` keeps it.

A folder belongs to one plan. A plan that differs is refused with the differences, but for those that only add cells.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from itertools import product
from pathlib import Path
from typing import Any, Self, get_args

import numpy as np

from handsight import __version__
from handsight.datasets.atomic import write_text
from handsight.datasets.curation.folds import Grouping
from handsight.datasets.errors import counted
from handsight.datasets.format.schema import Viewpoint
from handsight.datasets.inputs.augmentation import Jitter
from handsight.training.errors import SweepFolderError, SweepPlanError
from handsight.training.gqn import GqnConfig
from handsight.training.settings import TrainSettings
from handsight.training.sweep.cell import Cell, axis_faults
from handsight.training.sweep.divisions import refuse

PLAN = "plan.json"
PLAN_VERSION = 1
MOST_TRIALS = 1000
_GROWS = ("channels", "sizes", "varied", "trials")
"""Parts of which more may be asked for later: the cells that are there stay what they are."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepDataset:
    """A version that a sweep reads."""

    address: str
    ref: str
    snapshot: str
    digest: str
    viewpoint: Viewpoint
    attempts: int
    """Labelled attempts with that picture."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepPlan:
    """What is trained."""

    datasets: tuple[SweepDataset, ...]
    channels: tuple[str, ...]
    sizes: tuple[int | None, ...]
    """Attempts in training sets; None for all that are not held out."""
    trials: int
    by: Grouping = "object"
    held_out: float = 0.2
    """Share of the groups that a trial holds out."""
    seed: int = 0
    varied: dict[str, tuple[str, ...]] = field(default_factory=dict)
    recipe: TrainSettings = field(default_factory=TrainSettings)
    """Channels and seed of it do not count."""
    divisions: tuple[tuple[str, ...], ...] = ()
    """Digests of the divisions of each dataset, trial by trial."""
    handsight: str = __version__

    @property
    def dataset_names(self) -> tuple[str, ...]:
        """What its datasets are called in tables: the last parts of their addresses, if that tells them apart."""
        short = tuple(one.address.rpartition("/")[2] for one in self.datasets)
        return short if len(set(short)) == len(short) else tuple(one.address for one in self.datasets)

    def __post_init__(self) -> None:
        faults = axis_faults(self.channels, self.sizes, self.varied, self.recipe)
        if not 1 <= self.trials <= MOST_TRIALS:
            faults.append(f"{counted(self.trials, 'trial')} asked for, expected 1 to {MOST_TRIALS}")
        if not 0 < self.held_out < 1:
            faults.append(f"the share held out is {self.held_out}, expected above 0 and below 1")
        if self.by not in get_args(Grouping):
            faults.append(f"groups are by {self.by!r}, expected one of: {', '.join(get_args(Grouping))}")
        if self.seed < 0:
            faults.append(f"seed is {self.seed}, expected 0 or more")
        refuse(faults)

    def cells(self) -> Iterator[Cell]:
        """All cells, trial by trial, large ones first: a sweep that is stopped has whole trials, and ends evenly."""
        sizes = sorted(self.sizes, key=lambda size: -np.inf if size is None else -size)
        variants = [tuple(zip(self.varied, values, strict=True)) for values in product(*self.varied.values())]
        axes = product(range(self.trials), sizes, range(len(self.datasets)), variants, self.channels)
        for trial, size, dataset, varied, channels in axes:
            yield Cell(dataset=dataset, channels=channels, size=size, trial=trial, varied=varied)

    def training_seed(self, trial: int) -> int:
        """From which the networks of a trial start; the same for all of its cells."""
        return int(np.random.SeedSequence([self.seed, trial, 1]).generate_state(1, np.uint64)[0] >> 1)

    def to_json(self) -> dict[str, Any]:
        """As JSON values."""
        recipe = {**asdict(self.recipe), "network": self.recipe.network.to_json()}
        return json.loads(json.dumps({"plan_version": PLAN_VERSION, **asdict(self), "recipe": recipe}))  # type: ignore[no-any-return]

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> Self:
        """From what :meth:`to_json` gave.

        Raises:
            KeyError, TypeError, ValueError: Values are missing, of another kind, or out of range.
        """
        parts = {name: value for name, value in values.items() if name != "plan_version"}
        recipe = dict(parts["recipe"])
        network, jitter = GqnConfig.from_json(recipe.pop("network")), Jitter(**recipe.pop("jitter"))
        return cls(
            **{
                **parts,
                "datasets": tuple(SweepDataset(**one) for one in parts["datasets"]),
                "channels": tuple(parts["channels"]),
                "sizes": tuple(parts["sizes"]),
                "varied": {name: tuple(some) for name, some in parts["varied"].items()},
                "recipe": TrainSettings(network=network, jitter=jitter, **recipe),
                "divisions": tuple(tuple(some) for some in parts["divisions"]),
            }
        )


def write_plan(folder: Path, plan: SweepPlan) -> None:
    """Write the plan of a folder, whole or not at all."""
    write_text(folder / PLAN, json.dumps(plan.to_json(), indent=2) + "\n", durable=True)


def read_plan(folder: Path) -> SweepPlan:
    """The plan of a folder.

    Raises:
        SweepFolderError: There is none, or it is damaged or newer than this handsight.
    """
    path = folder / PLAN
    if not path.is_file():
        raise SweepFolderError(
            f"{folder} holds no sweep ({PLAN} is missing): to begin one, see 'handsight ablate --help'"
        )
    try:
        values = json.loads(path.read_bytes().decode())
        version = values["plan_version"]
        if isinstance(version, int) and version > PLAN_VERSION:
            raise SweepFolderError(
                f"{path} was written by a newer handsight (plan version {version}, this one reads up to "
                f"{PLAN_VERSION}): upgrade handsight"
            )
        return SweepPlan.from_json(values)
    except SweepFolderError:
        raise
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise SweepFolderError(
            f"{path} is damaged ({error}): restore it from a copy, or begin in a new folder"
        ) from error


def extended(old: SweepPlan, new: SweepPlan, *, allowed: Sequence[str] = ()) -> SweepPlan:
    """The plan of a folder that holds one, once another is asked for: what both have, and what the new one adds.

    Args:
        old: The plan that the folder was begun with.
        new: The plan that is asked for.
        allowed: Other parts, by name, in which the new one may differ.

    Raises:
        SweepPlanError: They differ in more; every difference is named.
    """
    was, now = old.to_json(), new.to_json()
    faults = [
        f"{part} {shown_value(was[part])}, now {shown_value(now[part])}"
        for part in now
        if part not in allowed and not _is_more(part, was.get(part), now[part])
    ]
    if faults:
        raise SweepPlanError(
            f"the folder is of another plan: {'; '.join(faults)}: begin in a new folder, or allow a difference that "
            "does no harm with --allow NAME"
        )
    return new


def _is_more(part: str, was: Any, now: Any) -> bool:
    """Whether nothing that was asked for is missing."""
    if part == "trials":
        return bool(was <= now)
    if part == "divisions":
        return all(later[: len(earlier)] == earlier for earlier, later in zip(was, now, strict=True))
    if part == "varied":
        return was.keys() == now.keys() and all(set(was[name]) <= set(now[name]) for name in was)
    return set(was) <= set(now) if part in _GROWS else bool(was == now)


def shown_value(value: Any) -> str:
    """A part of a plan as messages have it: JSON, cut short where it is long."""
    text = json.dumps(value)
    return text if len(text) <= 120 else f"{text[:117]}..."
