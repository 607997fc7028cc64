"""``handsight train``: a Grasp Quality Network from a dataset."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from handsight.cli.opening import checked_address, open_version
from handsight.cli.options import MOST_EPOCHS, Dataset, DryRun, Json, Seed
from handsight.cli.output import bold, console, print_json, progress_bar
from handsight.datasets.errors import counted
from handsight.datasets.inputs.viewpoint import DEFAULT_VIEWPOINT
from handsight.training.run_folder import RUN_RECORD, check_run_folder

if TYPE_CHECKING:
    # PyTorch takes seconds; nothing is imported where there is no dataset, or no place for a run.
    from handsight.datasets.inputs.materialize import GraspInputs
    from handsight.datasets.reading.reader import GraspDataset
    from handsight.servoing.homography import InputGrid
    from handsight.training.metrics import Metrics
    from handsight.training.trainer import Epoch, TrainSettings


def train_command(
    dataset: Dataset,
    out: Annotated[Path, typer.Option("--out", metavar="RUN", help="Folder for the trained run.")],
    channels: Annotated[Literal["rgbd", "rgb", "depth"], typer.Option(help="What the network reads.")] = "rgbd",
    epochs: Annotated[int, typer.Option(max=MOST_EPOCHS, help="Passes over the data.")] = 20,
    batch: Annotated[int, typer.Option(max=1_000_000, help="Inputs per step.")] = 200,
    viewpoint: Annotated[
        Literal["overhead", "pregrasp"], typer.Option(help="Picture that is warped to the grasp.")
    ] = DEFAULT_VIEWPOINT,
    seed: Seed = 0,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace a run that is there, once the new one is trained.")
    ] = False,
    dry_run: DryRun = False,
    as_json: Json = False,
) -> None:
    """Train a network on a version of a dataset (section V-A)."""
    checked_address(dataset)
    check_run_folder(out, overwrite=overwrite)
    from handsight.training.gqn import GqnConfig
    from handsight.training.trainer import TrainSettings

    settings = TrainSettings(network=GqnConfig(channels=channels), epochs=epochs, batch=batch, seed=seed)
    opened = open_version(dataset)
    if dry_run:
        _print_plan(opened, out, viewpoint, as_json=as_json)
        return
    final = train_to_folder(opened, dataset, out, settings, viewpoint=viewpoint, overwrite=overwrite)
    if as_json:
        print_json({"run": out, "epoch": final})
    else:
        console.print(bold(out), f": {describe(final.held_out)}")


def _print_plan(dataset: GraspDataset, out: Path, viewpoint: Literal["overhead", "pregrasp"], *, as_json: bool) -> None:
    """What there is to learn from, and whether a run would make room for the new one."""
    from handsight.datasets.inputs.materialize import usable_attempts

    attempts, replaces = len(usable_attempts(dataset, viewpoint)), (out / RUN_RECORD).is_file()
    if as_json:
        print_json({"run": out, "epoch": None, "attempts": attempts, "replaces": replaces})
        return
    instead = ", in place of the run that is there" if replaces else ""
    console.print(f"would train on {counted(attempts, 'attempt')} and write ", bold(out), instead)


def describe(held_out: Metrics) -> str:
    """How good the network is, in words."""
    if held_out.accuracy is None or held_out.auc is None:
        return f"too few attempts held out ({held_out.attempts}) to say how good it is"
    held = f"{counted(held_out.attempts, 'attempt')} held out"
    return f"balanced accuracy {held_out.accuracy:.2f}, AUC {held_out.auc:.2f} on {held}"


def train_to_folder(
    dataset: GraspDataset,
    name: str,
    out: Path,
    settings: TrainSettings,
    *,
    viewpoint: Literal["overhead", "pregrasp"],
    overwrite: bool = False,
) -> Epoch:
    """Materialize, train and save behind progress bars; returns the last epoch.

    A run that is there is replaced at the end, if at all.
    """
    check_run_folder(out, overwrite=overwrite)
    from handsight.servoing.homography import InputGrid
    from handsight.training.run import DataOrigin, save_run
    from handsight.training.trainer import train

    grid = InputGrid(size_px=settings.network.size_px)
    data = _materialize(dataset, viewpoint, grid)
    with progress_bar("train", settings.epochs) as bar:
        network, history = train(data, settings, on_epoch=lambda epoch: bar.advance(f"loss {epoch.train_loss:.3f}"))
    origin = DataOrigin(
        dataset=name,
        ref=dataset.ref,
        snapshot=dataset.snapshot_id,
        digest=dataset.digest,
        view=viewpoint,
        attempts=len(data.attempts),
    )
    save_run(out, network, origin=origin, grid=grid, settings=settings, history=history, overwrite=overwrite)
    return history[-1]


def _materialize(dataset: GraspDataset, viewpoint: Literal["overhead", "pregrasp"], grid: InputGrid) -> GraspInputs:
    from handsight.datasets.inputs.materialize import materialize

    with progress_bar("warp", len(dataset.attempts)) as bar:
        return materialize(dataset, viewpoint=viewpoint, grid=grid, on_attempt=bar.advance)
