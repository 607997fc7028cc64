"""``handsight train``: a Grasp Quality Network from one or more datasets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import accumulate, pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from handsight.cli.errors import CommandError
from handsight.cli.opening import check_named_once, checked_address, open_version
from handsight.cli.options import MOST_ATTEMPTS, MOST_EPOCHS, Datasets, DryRun, Filter, Json, Seed, Where
from handsight.cli.output import bold, console, print_json, progress_bar
from handsight.datasets.errors import counted
from handsight.datasets.inputs.viewpoint import DEFAULT_VIEWPOINT
from handsight.training.event_files import check_tensorboard, event_files
from handsight.training.run_folder import RUN_RECORD, check_run_folder

if TYPE_CHECKING:
    # PyTorch takes seconds; nothing is imported where there is no dataset, or no place for a run.
    import pandas as pd

    from handsight.datasets.inputs.materialize import GraspInputs
    from handsight.datasets.reading.reader import GraspDataset
    from handsight.servoing.homography import InputGrid
    from handsight.training.course import Epoch
    from handsight.training.data_selection import DataSelection
    from handsight.training.metrics import Metrics
    from handsight.training.run import DataOrigin
    from handsight.training.settings import TrainSettings
    from handsight.training.trainer import Trained

ViewpointName = Literal["overhead", "pregrasp"]
DEFAULT_RATE = 2e-3
"""``TrainSettings`` has it too, and a test that they agree."""


_OF_THE_RECIPE = ("channels", "epochs", "batch", "lr")
"""Options that a recipe has a value of."""


def train_command(
    ctx: typer.Context,
    datasets: Datasets,
    out: Annotated[Path, typer.Option("--out", metavar="RUN", help="Folder for the trained run.")],
    channels: Annotated[Literal["rgbd", "rgb", "depth"], typer.Option(help="What the network reads.")] = "rgbd",
    epochs: Annotated[
        int,
        typer.Option(max=MOST_EPOCHS, help="Most passes over the data; there are fewer where more would not help."),
    ] = 40,
    batch: Annotated[int, typer.Option(max=1_000_000, help="Inputs per step.")] = 200,
    viewpoint: Annotated[
        Literal["overhead", "pregrasp", "both"],
        typer.Option(help="Picture that is warped to the grasp; both, where there are both, as two inputs."),
    ] = DEFAULT_VIEWPOINT,
    seed: Seed = 0,
    where: Where = "",
    filter: Filter = "",
    folds: Annotated[
        str,
        typer.Option(
            metavar="NAME:FOLD",
            help="Stored folds, and the one of them that is left out; see 'handsight dataset folds --help'.",
        ),
    ] = "",
    size: Annotated[
        int | None, typer.Option(min=2, max=MOST_ATTEMPTS, help="Attempts to train on, drawn by the seed.")
    ] = None,
    lr: Annotated[float, typer.Option("--lr", help="Learning rate.")] = DEFAULT_RATE,
    recipe: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Train by the recipe of a search, its best.json, channels included; see 'handsight tune --help'.",
        ),
    ] = None,
    device: Annotated[
        Literal["auto", "cpu", "cuda"], typer.Option(help="Where to train; auto is a GPU where there is one.")
    ] = "cpu",
    resume: Annotated[bool, typer.Option("--resume", help="Go on with a training that was interrupted.")] = False,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace a run that is there, once the new one is trained.")
    ] = False,
    tensorboard: Annotated[
        bool, typer.Option("--tensorboard", help="Write losses and figures to RUN/tensorboard after every pass.")
    ] = False,
    dry_run: DryRun = False,
    as_json: Json = False,
) -> None:
    """Train a network on a version of a dataset, or on several (section V-A).

    Training ends when the loss on attempts that were held out no longer falls, and keeps the network that was best.
    """
    check_named_once(datasets)
    for dataset in datasets:
        checked_address(dataset)
    fold_name, fold = fold_of(folds)
    check_run_folder(out, overwrite=overwrite, resume=resume)
    if tensorboard:
        check_tensorboard()
    if recipe is not None:
        _check_recipe(recipe, [name for name in _OF_THE_RECIPE if _is_given(ctx, name)])
    from handsight.training.data_selection import DataSelection
    from handsight.training.gqn import GqnConfig
    from handsight.training.recipe_file import read_recipe
    from handsight.training.settings import TrainSettings

    settings = (
        TrainSettings(network=GqnConfig(channels=channels), epochs=epochs, batch=batch, learning_rate=lr, seed=seed)
        if recipe is None
        else read_recipe(recipe, seed=seed)
    )
    selection = DataSelection(where=where, filter=filter, folds=fold_name, fold=fold, size=size)
    opened = {dataset: open_version(dataset) for dataset in datasets}
    pictures: tuple[ViewpointName, ...] = ("overhead", "pregrasp") if viewpoint == "both" else (viewpoint,)
    if dry_run:
        _print_plan(opened, out, pictures, selection, as_json=as_json)
        return
    trained = train_to_folder(
        opened,
        out,
        settings,
        viewpoints=pictures,
        selection=selection,
        device=device,
        resume=resume,
        overwrite=overwrite,
        tensorboard=tensorboard,
    )
    if as_json:
        print_json({"run": out, "epoch": trained.kept})
    else:
        passes = f"pass {trained.kept.number} of {len(trained.history)} kept"
        console.print(bold(out), f": {describe(trained.kept.held_out)}; {passes}")


def _is_given(ctx: typer.Context, name: str) -> bool:
    source = ctx.get_parameter_source(name)
    return source is not None and source.name == "COMMANDLINE"


def _check_recipe(recipe: Path, given: Sequence[str]) -> None:
    """Refuse a recipe that is not there, and options that it has a value of.

    Raises:
        CommandError: It is no file, or there are such options.
    """
    if not recipe.is_file():
        raise CommandError(f"--recipe is {recipe}, expected a file: best.json of a search, see 'handsight tune --help'")
    if given:
        options = ", ".join(f"--{name}" for name in given)
        raise CommandError(f"{options} is given beside --recipe, which has a value of its own: leave one of them out")


def fold_of(text: str) -> tuple[str, int]:
    """Folds and the one that is left out, from ``NAME:FOLD``; no name where nothing is given.

    Raises:
        CommandError: The text has another form.
    """
    name, colon, fold = text.rpartition(":")
    if text and not (name and colon and fold.isascii() and fold.isdecimal() and len(fold) < 4):
        raise CommandError(f"--folds is {text!r}, expected NAME:FOLD, such as by-object:0")
    return (name, int(fold)) if text else ("", 0)


def _print_plan(
    datasets: Mapping[str, GraspDataset],
    out: Path,
    viewpoints: Sequence[ViewpointName],
    selection: DataSelection,
    *,
    as_json: bool,
) -> None:
    """What there is to learn from, and whether a run would make room for the new one."""
    found = _usable(datasets, viewpoints)
    parts = {(name, view): len(rows) for name, view, rows in found}
    if not selection.is_all:
        masks = [selection.chosen(datasets[name], rows) for name, _, rows in found]
        parts = {(name, view): int(mask.sum()) for (name, view, _), mask in zip(found, masks, strict=True)}
    inputs, replaces = sum(parts.values()), (out / RUN_RECORD).is_file()
    if selection.size is not None:
        inputs = min(inputs, selection.size * len(viewpoints))
    if as_json:
        listed = [{"dataset": name, "view": view, "attempts": usable} for (name, view), usable in parts.items()]
        print_json({"run": out, "epoch": None, "attempts": inputs, "parts": listed, "replaces": replaces})
        return
    instead = ", in place of the run that is there" if replaces else ""
    if len(parts) > 1:
        for (name, view), usable in parts.items():
            console.print(f"{name}: {counted(usable, 'attempt')}, {view} picture")
    what = counted(inputs, "attempt") if len(parts) == 1 else f"{counted(inputs, 'picture')} in all"
    console.print(f"would train on {what} and write ", bold(out), instead)


def _usable(
    datasets: Mapping[str, GraspDataset], viewpoints: Sequence[ViewpointName]
) -> list[tuple[str, ViewpointName, pd.DataFrame]]:
    """What each dataset has of each picture. One of them is enough: on-policy data may have what others lack.

    Raises:
        NoTrainingDataError: A dataset has no labelled attempt with any of the pictures.
    """
    from handsight.datasets.errors import NoTrainingDataError
    from handsight.datasets.inputs.materialize import usable_attempts

    found: list[tuple[str, ViewpointName, pd.DataFrame]] = []
    for name, dataset in datasets.items():
        faults: list[NoTrainingDataError] = []
        for view in viewpoints:
            try:
                found.append((name, view, usable_attempts(dataset, view)))
            except NoTrainingDataError as error:
                faults.append(error)
        if len(faults) == len(viewpoints):
            raise faults[0]
    return found


def describe(held_out: Metrics) -> str:
    """How good the network is, in words."""
    if held_out.accuracy is None or held_out.auc is None:
        return f"too few attempts held out ({held_out.attempts}) to say how good it is"
    held = f"{counted(held_out.attempts, 'attempt')} held out"
    return f"balanced accuracy {held_out.accuracy:.2f}, AUC {held_out.auc:.2f} on {held}"


def train_to_folder(
    datasets: Mapping[str, GraspDataset],
    out: Path,
    settings: TrainSettings,
    *,
    viewpoints: Sequence[ViewpointName],
    selection: DataSelection | None = None,
    device: str = "cpu",
    resume: bool = False,
    overwrite: bool = False,
    tensorboard: bool = False,
) -> Trained:
    """Materialize, train and save behind progress bars.

    A run that is there is replaced at the end, if at all.

    Args:
        datasets: Versions by the names that the run is to give them.
        out: Folder of the run.
        settings: The recipe.
        viewpoints: Pictures that are warped to the grasp, all that a dataset has of these.
        selection: Which of their attempts; all unless given.
        device: Where to train: ``cpu``, ``cuda``, or ``auto`` for a GPU where there is one.
        resume: Whether to go on with a training that was interrupted.
        overwrite: Whether a run may be replaced.
        tensorboard: Whether event files are written below the folder.
    """
    check_run_folder(out, overwrite=overwrite, resume=resume)
    import pandas as pd

    from handsight.datasets.inputs.mixture import mixed
    from handsight.datasets.views import input_span_m
    from handsight.servoing.homography import InputGrid
    from handsight.training.data_selection import EVERYTHING
    from handsight.training.devices import device_named
    from handsight.training.lineage import note_run
    from handsight.training.run import save_run
    from handsight.training.run_folder import CHECKPOINT
    from handsight.training.trainer import train

    selection, where_trained = selection or EVERYTHING, device_named(device)
    grid = InputGrid(size_px=settings.network.size_px)
    wanted = _usable(datasets, viewpoints)
    masks = [selection.chosen(datasets[name], rows) for name, _, rows in wanted]
    every = pd.concat([rows[["success"]] for _, _, rows in wanted]).index
    chosen = selection.rows(masks, every, settings.seed)  # before anything is warped
    first = datasets[wanted[0][0]].sessions[0].header.station
    grid = replace(grid, span_m=input_span_m(first, grid))
    parts = [_materialize(datasets[name], view, grid) for name, view, _ in wanted]
    starts = [0, *accumulate(len(part.attempts) for part in parts)]
    origins = [
        _origin(datasets[name], name, view, int(((chosen >= start) & (chosen < end)).sum()))
        for (name, view, _), (start, end) in zip(wanted, pairwise(starts), strict=True)
    ]
    checkpoint = out / CHECKPOINT
    if not resume:
        checkpoint.unlink(missing_ok=True)
    out.mkdir(parents=True, exist_ok=True)
    with progress_bar("train", settings.epochs) as bar, event_files(out, wanted=tensorboard) as events:

        def on_epoch(epoch: Epoch) -> None:
            bar.advance(_losses(epoch))
            if events is not None:
                events.add(epoch)

        rows = None if selection.is_all else chosen
        trained = train(
            mixed(parts), settings, rows=rows, on_epoch=on_epoch, checkpoint=checkpoint, device=where_trained
        )
    save_run(
        out,
        trained.network,
        origins=origins,
        grid=grid,
        settings=settings,
        history=trained.history,
        kept_epoch=trained.kept.number,
        selection=None if selection.is_all else selection.to_json(),
        overwrite=overwrite,
    )
    note_run(out, datasets)
    return trained


def _losses(epoch: Epoch) -> str:
    held_out = epoch.held_out.loss
    return f"loss {epoch.train_loss:.3f}" + ("" if held_out is None else f", held out {held_out:.3f}")


def _origin(dataset: GraspDataset, name: str, view: ViewpointName, attempts: int) -> DataOrigin:
    from handsight.training.run import DataOrigin

    return DataOrigin(
        dataset=name,
        ref=dataset.ref,
        snapshot=dataset.snapshot_id,
        digest=dataset.digest,
        view=view,
        attempts=attempts,
    )


def _materialize(dataset: GraspDataset, viewpoint: ViewpointName, grid: InputGrid) -> GraspInputs:
    from handsight.datasets.inputs.materialize import materialize

    with progress_bar("warp", len(dataset.attempts)) as bar:
        return materialize(dataset, viewpoint=viewpoint, grid=grid, on_attempt=bar.advance)
