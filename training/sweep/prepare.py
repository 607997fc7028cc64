"""A sweep made ready: data opened, trials divided, everything refused that would fail after hours."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from handsight.datasets.curation.folds import Grouping
from handsight.datasets.format.schema import Viewpoint
from handsight.datasets.inputs.materialize import usable_attempts
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.writable import folder_fault
from handsight.training.errors import SweepFolderError
from handsight.training.settings import TrainSettings
from handsight.training.sweep.divisions import divide, division_faults, group_names, refuse
from handsight.training.sweep.folder import CELLS
from handsight.training.sweep.plan import PLAN, SweepDataset, SweepPlan, extended, read_plan, write_plan

USUAL_SIZES = (250, 500, 1_000, 2_000, 5_000, 10_000, 20_000, 30_000)
"""Sizes of training sets where none are asked for, as far as there are attempts."""


def plan_sweep(
    versions: Mapping[str, GraspDataset],
    *,
    viewpoint: Viewpoint,
    channels: Sequence[str],
    sizes: Sequence[int | None],
    trials: int,
    by: Grouping,
    held_out: float,
    seed: int,
    varied: Mapping[str, Sequence[str]],
    recipe: TrainSettings,
) -> SweepPlan:
    """The plan of a sweep, once all of its trials are known to be possible. Nothing is written, and no input made.

    Args:
        versions: By the addresses that they were given by.
        viewpoint: Which picture is warped to the grasp.
        channels: What networks read.
        sizes: Attempts in training sets, None for all that are not held out; without any, the usual ones.
        trials: How often objects are drawn anew and held out.
        by: What is never on both sides.
        held_out: Share of these that a trial holds out.
        seed: Of the trials.
        varied: Values of other parts of the recipe, by name.
        recipe: What is common to all cells.

    Raises:
        SweepPlanError: Something is out of range, or a trial lacks what it needs; all of it is named.
        NoTrainingDataError: A version has nothing to learn from.
    """
    tables = {address: usable_attempts(dataset, viewpoint) for address, dataset in versions.items()}
    plan = SweepPlan(
        datasets=tuple(
            SweepDataset(
                address=address,
                ref=dataset.ref,
                snapshot=dataset.snapshot_id,
                digest=dataset.digest,
                viewpoint=viewpoint,
                attempts=len(tables[address]),
            )
            for address, dataset in versions.items()
        ),
        channels=tuple(channels),
        sizes=tuple(sizes) or (None,),
        trials=trials,
        by=by,
        held_out=held_out,
        seed=seed,
        varied={name: tuple(values) for name, values in varied.items()},
        recipe=recipe,
    )
    groups = group_names(list(tables.values()), by)
    divisions = [
        [divide(rows, groups, by=by, held_out=held_out, seed=seed, trial=trial) for trial in range(trials)]
        for rows in tables.values()
    ]
    if not sizes:
        least = min(len(division.pool) for some in divisions for division in some)
        plan = replace(plan, sizes=tuple(size for size in USUAL_SIZES if size <= least) or (None,))
    faults = []
    for rows, some in zip(tables.values(), divisions, strict=True):
        faults += division_faults(some, rows["success"].to_numpy(dtype="float32"), plan.sizes)
    refuse(faults)
    digests = tuple(
        tuple(division.digest(rows.index) for division in some)
        for rows, some in zip(tables.values(), divisions, strict=True)
    )
    return replace(plan, divisions=digests)


def settle(folder: Path, plan: SweepPlan, *, allowed: Sequence[str] = (), dry_run: bool = False) -> SweepPlan:
    """Make a folder the plan's, or see that it is; returns the plan that the folder has then.

    Raises:
        SweepFolderError: Something else is in the folder, or it cannot be written to.
        SweepPlanError: The folder is of another plan.
    """
    if (fault := folder_fault(folder)) is not None:
        raise SweepFolderError(f"no sweep can be written to {folder}: {fault}; choose another --out")
    if (folder / PLAN).is_file():
        old = read_plan(folder)
        plan = extended(old, plan, allowed=allowed)
        if plan == old:
            return plan
    elif folder.is_dir() and any(not path.name.startswith(".") for path in folder.iterdir()):
        raise SweepFolderError(f"{folder} holds other files, expected a new or empty folder: choose another --out")
    if not dry_run:
        (folder / CELLS).mkdir(parents=True, exist_ok=True)
        write_plan(folder, plan)
    return plan
