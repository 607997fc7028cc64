"""What ``handsight prediction`` measures on a simulated station, and how its tables look on the screen."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from handsight.cli.output import console, progress_bar
from handsight.cli.tables import Column, print_prose, print_table
from handsight.cli.wiring.stations import sim_station
from handsight.datasets.errors import counted
from handsight.evaluation.evaluate import TrialContextFactory
from handsight.evaluation.prediction_rows import PredictionRow, prediction_rows, why_nothing_was_seen
from handsight.evaluation.prediction_survey import SceneSurvey, SurveySettings, survey
from handsight.training.run import load_run

SIZES = {"move": "moved [mm]", "turn": "turned [deg]"}
"""What the column of sizes is called."""
ON_AVERAGE = (
    "score: predicted less true, mean size and its 90 % point; bias: mean. border: extrapolated pixels; hidden: wrong "
    "because an object hides them or shows a face; shifted: wrong in depth for no such reason; cloud: score "
    "where the point cloud predicts instead of the homography."
)


def survey_predictions(model: Path, objects: str, settings: SurveySettings, *, gripper: str) -> dict[str, Any]:
    """Look at the scenes behind a progress bar; returns what ``prediction --json`` prints.

    Raises:
        ObjectSetError: A set that cannot be used.
    """
    station = sim_station(objects, gripper=gripper)
    run = load_run(model)
    factory = TrialContextFactory(open_station=station, run=model, weights_sha256=run.weights_sha256)
    with progress_bar("scenes", settings.scenes) as bar:
        scenes = survey(factory, settings, on_scene=lambda _: bar.advance())
    return {
        "rows": prediction_rows(scenes),
        "fault": why_nothing_was_seen(scenes),
        "model": str(model),
        "weights_sha256": run.weights_sha256,
        "objects": objects,
        "gripper": gripper,
        "seed": settings.seed,
        "scenes": settings.scenes,
        "failed": [{"scene": scene.number, "failure": scene.failure} for scene in scenes if scene.failure],
        "unreachable": sum(scene.unreachable for scene in scenes),
        "samples": [sample for scene in scenes for sample in _samples(scene)],
    }


def print_predictions(results: dict[str, Any]) -> None:
    """A table of errors and one by height for each kind of step, and what was left out."""
    for kind, size in SIZES.items():
        rows = [row for row in results["rows"] if row["kind"] == kind]
        if rows:
            _print_errors([row for row in rows if row["height_low_mm"] is None], size)
            _print_heights([row for row in rows if row["height_low_mm"] is not None], size)
    print_prose(ON_AVERAGE)
    if results["failed"] or results["unreachable"]:
        print_prose(
            f"left out: {counted(len(results['failed']), 'scene')} that could not be looked at, "
            f"{counted(results['unreachable'], 'step')} that began out of reach"
        )


def _print_errors(rows: Sequence[PredictionRow], size: str) -> None:
    cells = [
        (
            _between(row["low"], row["high"]),
            str(row["steps"]),
            f"{row['colour_rms']:.3f}",
            f"{row['height_rms_mm']:.1f}",
            f"{row['extrapolated']:.1%}",
            f"{row['occluded']:.1%}",
            f"{row['displaced']:.1%}",
            f"{row['score_error']:.3f}",
            f"{row['score_error_90']:.3f}",
            f"{row['score_bias']:+.3f}",
            f"{row['points_score_error']:.3f}",
        )
        for row in rows
    ]
    columns = (
        size,
        Column(heading="n", rank=2),
        "colour",
        "mm",
        "border",
        "hidden",
        Column(heading="shifted", rank=1),
        "score",
        "90 %",
        "bias",
        Column(heading="cloud", rank=1),
    )
    print_table(columns, cells)
    console.print()


def _print_heights(rows: Sequence[PredictionRow], size: str) -> None:
    """Height and score errors, one column for each bin of heights."""
    counts: dict[tuple[float, float | None], int] = {}
    for row in rows:
        ends = (row["height_low_mm"] or 0.0, row["height_high_mm"])
        counts[ends] = max(counts.get(ends, 0), row["steps"])
    bins = sorted(counts, key=lambda ends: ends[0])
    sizes = dict.fromkeys((row["low"], row["high"]) for row in rows)
    found = {(row["low"], row["height_low_mm"]): row for row in rows}
    cells = [
        (_between(low, high), *(_height_cell(found.get((low, height_mm))) for height_mm, _ in bins))
        for low, high in sizes
    ]
    console.print("error of height [mm] and of score, by the height of the object at the grasp [mm]")
    print_table((size, *(f"{_between(*ends)} (n {counts[ends]})" for ends in bins)), cells)
    console.print()


def _height_cell(row: PredictionRow | None) -> str:
    return "-" if row is None else f"{row['height_rms_mm']:.1f} {row['score_error']:.3f}"


def _between(low: float, high: float | None) -> str:
    return f"{low:g} or more" if high is None else f"{low:g} - {high:g}"


def _samples(scene: SceneSurvey) -> Iterable[dict[str, Any]]:
    for one in scene.samples:
        yield {
            "scene": scene.number,
            "kind": one.kind,
            "size": one.size,
            "height_m": one.height_m,
            "colour_rms": one.error.colour_rms,
            "height_rms_m": one.error.height_rms_m,
            "predicted_score": one.error.predicted_score,
            "true_score": one.error.true_score,
            "extrapolated": one.error.faults.extrapolated,
            "occluded": one.error.faults.occluded,
            "displaced": one.error.faults.displaced,
            "points_height_rms_m": one.error.points_height_rms_m,
            "points_score": one.error.points_score,
        }
