"""``handsight demo``: the whole line in one command, safe to interrupt and to run again."""

from __future__ import annotations

import json
import shlex
import shutil
import sys
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from handsight.cli.collect import collect_with_progress
from handsight.cli.opening import check_out_folder
from handsight.cli.options import (
    DEFAULT_GRIPPER,
    DEFAULT_METHOD,
    MOST_ATTEMPTS,
    MOST_TRIALS,
    NOVEL_OBJECTS,
    TRAINING_OBJECTS,
    Gripper,
    Json,
    Seed,
    Workers,
)
from handsight.cli.output import Output, bold, console, errors, print_json
from handsight.cli.servo import write_trace
from handsight.cli.train import describe, train_to_folder
from handsight.cli.wiring.evaluation_tables import print_results
from handsight.cli.wiring.evaluations import evaluate_model
from handsight.cli.wiring.heatmaps import HeatmapRequest, make_heatmaps
from handsight.cli.wiring.stations import sim_station
from handsight.collection.collector import CollectSettings
from handsight.datasets.atomic import atomic_file
from handsight.datasets.errors import counted
from handsight.datasets.inputs.viewpoint import DEFAULT_VIEWPOINT
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.store.repository import GraspRepository
from handsight.evaluation.errors import TrialAbortedError
from handsight.evaluation.evaluate import EvaluationSettings, TrialContextFactory, record_trial
from handsight.evaluation.results import ResultRow
from handsight.servoing.methods.registry import METHODS
from handsight.training.metrics import Metrics
from handsight.training.run import load_run
from handsight.training.run_folder import RUN_RECORD
from handsight.training.settings import TrainSettings
from handsight.viz.figures.results import results_figure
from handsight.viz.recordings.heatmaps import write_heatmaps

SHOWN_METHODS = ("random", "cem-1", "first-order", "global")
"""The baseline, the paper's two best, and the one that goes beyond them."""


@dataclass(frozen=True, slots=True)
class DemoPaths:
    """Where the demo leaves what."""

    out: Path

    @property
    def dataset(self) -> Path:
        """The collected dataset."""
        return self.out / "grasps"

    @property
    def run(self) -> Path:
        """The trained run."""
        return self.out / "run"

    @property
    def results(self) -> Path:
        """What ``evaluate --json`` prints."""
        return self.out / "results.json"

    @property
    def figure(self) -> Path:
        """The table of results as a picture."""
        return self.out / "results.png"

    @property
    def heatmaps(self) -> Path:
        """Recording of heatmaps."""
        return self.out / "heatmaps.rrd"

    @property
    def trace(self) -> Path:
        """Recording of a servo run."""
        return self.out / "servo_trace.rrd"

    def files(self) -> dict[str, Path]:
        """What there is beside the dataset, by what it is; an aborted trial leaves no recording."""
        made = {
            "run": self.run,
            "results": self.results,
            "figure": self.figure,
            "heatmaps": self.heatmaps,
            "trace": self.trace,
        }
        return {what: path for what, path in made.items() if path.exists()}


def demo(
    out: Annotated[Path, typer.Option("--out", help="Folder for everything the demo makes.")] = Path("demo"),
    attempts: Annotated[
        int, typer.Option("--attempts", "-n", max=MOST_ATTEMPTS, help="Grasp attempts to collect.")
    ] = 600,
    trials: Annotated[int, typer.Option(max=MOST_TRIALS, help="Evaluation trials of each method.")] = 50,
    seed: Seed = 0,
    workers: Workers = 2,
    gripper: Gripper = DEFAULT_GRIPPER,
    as_json: Json = False,
) -> None:
    """Collect grasps, train a network, servo on objects it never saw, and show the results.

    Takes a few minutes on two cores. Interrupt it and run it again: it goes on where it was.
    """
    collecting = CollectSettings(attempts=attempts, seed=seed, workers=workers)
    evaluating = EvaluationSettings(methods=SHOWN_METHODS, trials=trials, workers=workers)
    paths = DemoPaths(out)
    check_out_folder(out)
    tell = errors if as_json else console
    release = _collect(paths, collecting, gripper, tell)
    _train(paths, release, TrainSettings(seed=seed), tell)
    results = _evaluate(paths, evaluating, gripper, tell)
    _record(paths, release, results, evaluating, gripper, tell)
    if as_json:
        print_json({**results, "dataset": f"{paths.dataset}@{release}", "files": paths.files()})
    else:
        _show(paths, release, results["rows"])
    if results["fault"] is not None:
        errors.print(f"error: {results['fault']}")
        raise typer.Exit(1)


def _collect(paths: DemoPaths, settings: CollectSettings, gripper: str, tell: Output) -> str:
    """Collect what is missing and release it; returns the release's name."""
    _headline(f"1  Collect {counted(settings.attempts, 'grasp attempt')} in simulation", tell)
    collect_with_progress(paths.dataset, sim_station(TRAINING_OBJECTS, gripper=gripper), settings, resume=True)
    repository = GraspRepository.open(paths.dataset)
    name = f"demo-seed{settings.seed}-{settings.attempts}"
    if name not in repository.releases():
        repository.release(name, message="collected by 'handsight demo'")
    facts = GraspDataset.open(f"{paths.dataset}@{name}").info()
    tell.print(
        f"   {paths.dataset}@{name}: {counted(facts.attempts, 'attempt')}, {facts.successes / facts.attempts:.1%} of "
        f"the random grasps succeed, {facts.bytes / 1e6:.0f} MB, digest {facts.digest[:12]}"
    )
    return name


def _train(paths: DemoPaths, release: str, settings: TrainSettings, tell: Output) -> None:
    _headline("2  Train the Grasp Quality Network", tell)
    address = f"{paths.dataset}@{release}"
    dataset = GraspDataset.open(address)
    if not (paths.run / RUN_RECORD).exists() or not _was_trained_on(paths.run, dataset):
        train_to_folder({address: dataset}, paths.run, settings, viewpoints=[DEFAULT_VIEWPOINT], overwrite=True)
    record = load_run(paths.run).record
    held_out = Metrics(**record["history"][record["kept_epoch"] - 1]["held_out"])
    tell.print(f"   {paths.run}: {describe(held_out)}")


def _was_trained_on(run: Path, dataset: GraspDataset) -> bool:
    """Whether the run is of this version and of nothing else, and of a handsight that says which pass it kept."""
    trained = load_run(run)
    return {origin.digest for origin in trained.origins} == {dataset.digest} and trained.record.get(
        "kept_epoch"
    ) is not None


def _evaluate(paths: DemoPaths, settings: EvaluationSettings, gripper: str, tell: Output) -> dict[str, Any]:
    _headline(f"3  Servo on objects it never saw, {counted(settings.trials, 'trial')} of each method", tell)
    weights = load_run(paths.run).weights_sha256
    results = _read_results(paths.results)
    key = {
        "weights_sha256": weights,
        "trials_each": settings.trials,
        "seed": settings.seed,
        "gripper": gripper,
        "shown_methods": list(settings.methods),
    }
    # Results of earlier versions lack tables.
    if "comparisons" not in results or any(results.get(name) != value for name, value in key.items()):
        results = {**evaluate_model(paths.run, NOVEL_OBJECTS, settings, gripper=gripper), **key}
        with atomic_file(paths.results) as unfinished:
            unfinished.write_text(json.dumps(results, indent=2) + "\n", encoding="utf-8")
    return results


def _read_results(path: Path) -> dict[str, Any]:
    try:
        results = json.loads(path.read_text(encoding="utf-8"))
    except (FileNotFoundError, ValueError):
        return {}
    return results if isinstance(results, dict) else {}


def _record(
    paths: DemoPaths,
    release: str,
    results: dict[str, Any],
    settings: EvaluationSettings,
    gripper: str,
    tell: Output,
) -> None:
    _headline("4  Write the recordings and the figure", tell)
    dataset = GraspDataset.open(f"{paths.dataset}@{release}")
    made = make_heatmaps(dataset, paths.run, HeatmapRequest(wrong=True))
    write_heatmaps(paths.heatmaps, made.examples, made.overview)
    factory = TrialContextFactory(open_station=sim_station(NOVEL_OBJECTS, gripper=gripper), run=paths.run)
    number = _most_telling_trial(results["trials"])
    with suppress(TrialAbortedError):  # The best trial is one only where all were; the results have said why.
        recording = record_trial(factory, DEFAULT_METHOD, number, seed=settings.seed, servo=settings.servo)
        if recording is not None:
            write_trace(paths.trace, recording, paths.run)
    if rows := [row for row in results["rows"] if row["trials"]]:
        results_figure(rows, paths.figure)


def _most_telling_trial(trials: list[dict[str, Any]]) -> int:
    """The trial that shows most of the method.

    A success where random grasping failed, ended by the threshold and not by the step limit, after many moves.
    """
    lost = {trial["number"] for trial in trials if trial["method"] == "random" and not trial["success"]}
    limit = METHODS[DEFAULT_METHOD].max_steps

    def telling(trial: dict[str, Any]) -> tuple[bool, bool, bool, int]:
        return trial["success"], trial["number"] in lost, trial["moves"] < limit, trial["moves"]

    return int(max((one for one in trials if one["method"] == DEFAULT_METHOD), key=telling)["number"])


def _show(paths: DemoPaths, release: str, rows: list[ResultRow]) -> None:
    console.print()
    print_results(rows)
    handsight, rerun = _command_name("handsight"), _command_name("rerun")
    commands = [
        ("the dataset", shlex.join((handsight, "dataset", "ls", f"{paths.dataset}@{release}"))),
        ("as cards", shlex.join((handsight, "view", "dataset", str(paths.dataset)))),
        ("heatmaps", shlex.join((rerun, str(paths.heatmaps)))),
        ("a servo run", shlex.join((rerun, str(paths.trace)))),
        ("the figure", str(paths.figure)),
        ("one page", shlex.join((handsight, "report", str(paths.out)))),
        ("more trials", shlex.join((handsight, "evaluate", "--model", str(paths.run), "--trials", "200"))),
    ]
    for what, command in commands:
        console.print("  ", bold(f"{what:<12}"), f" {command}")


def _command_name(program: str) -> str:
    """How to call a program of this environment from here: by name, or by path where it is not on PATH."""
    if shutil.which(program):
        return program
    beside = Path(sys.executable).with_name(program)
    return str(beside.relative_to(Path.cwd())) if beside.is_relative_to(Path.cwd()) else str(beside)


def _headline(text: str, tell: Output) -> None:
    tell.print((text, "bold cyan"))
