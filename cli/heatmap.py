"""``handsight heatmap``: predicted success over recorded pictures (figure 8)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from handsight.cli.opening import check_out_file, checked_address, open_version
from handsight.cli.options import MOST_ATTEMPTS, Dataset, Ids, Json, Model
from handsight.cli.output import bold, console, print_json, progress_bar
from handsight.datasets.errors import counted, pasteable
from handsight.training.run_folder import check_finished_run

if TYPE_CHECKING:
    # PyTorch and Rerun take seconds; nothing is imported where there is no dataset or no run.
    from handsight.datasets.reading.reader import GraspDataset
    from handsight.viz.examples import HeatmapExample

COLUMNS = 4
"""Examples in one picture."""


def heatmap_command(
    dataset: Dataset,
    model: Model,
    attempts: Ids = None,
    out: Annotated[Path, typer.Option("--out", help="Recording to write, for 'rerun FILE'.")] = Path("heatmaps.rrd"),
    count: Annotated[
        int, typer.Option("--count", "-n", min=1, max=MOST_ATTEMPTS, help="How many of the latest, without ids.")
    ] = 8,
    spacing_px: Annotated[
        int, typer.Option("--spacing", min=1, max=10_000, help="Pixels between the points of the map.")
    ] = 8,
    picture: Annotated[
        Path | None,
        typer.Option("--picture", metavar="FILE.png", help=f"Draw the first {COLUMNS} side by side, for a document."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Write a recording of grasp heatmaps over the overhead pictures of a dataset."""
    checked_address(dataset)
    check_finished_run(model)
    check_out_file(out)
    from handsight.datasets.reading.attempt_ids import resolve_attempt_ids
    from handsight.viz.figures.montage import montage_figure
    from handsight.viz.figures.style import check_figure_path
    from handsight.viz.recordings.heatmaps import write_heatmaps

    if picture is not None:
        check_figure_path(picture, ".png")
    opened = open_version(dataset)
    chosen = resolve_attempt_ids(opened, attempts) if attempts else latest_attempts(opened, count)
    examples = heatmap_examples(opened, chosen, model, spacing_px=spacing_px)
    write_heatmaps(out, examples)
    if picture is not None:
        montage_figure(picture, examples[:COLUMNS])
    if as_json:
        print_json({"recording": out, "picture": picture, "attempts": chosen})
        return
    console.print(bold(out), f": heatmaps of {counted(len(chosen), 'attempt')}; open it with {pasteable('rerun', out)}")
    if picture is not None:
        console.print(bold(picture), f": the first {len(examples[:COLUMNS])} of them")


def latest_attempts(dataset: GraspDataset, count: int) -> list[str]:
    """Ids of the last attempts that took an overhead picture."""
    taken = dataset.attempts["overhead_taken"]
    return [str(key) for key in dataset.attempts.index[taken][-count:]]


def heatmap_examples(
    dataset: GraspDataset, attempts: Sequence[str], model: Path, *, spacing_px: int = 8
) -> list[HeatmapExample]:
    """Score the overhead pictures of some attempts."""
    from handsight.datasets.views import station_view
    from handsight.servoing.heatmap import grasp_heatmap
    from handsight.training.run import load_run
    from handsight.viz.examples import HeatmapExample

    run = load_run(model)
    scorer = run.scorer()
    examples = []
    with progress_bar("heatmaps", len(attempts)) as bar:
        for key, frame in dataset.frames("overhead", attempts):
            spec = dataset.station(key)
            view = station_view(frame, spec)
            heatmap = grasp_heatmap(view, scorer, spacing_px=spacing_px)
            examples.append(
                HeatmapExample(title=key, view=view, heatmap=heatmap, grid=run.grid, jaws_m=spec.gripper_stroke_m)
            )
            bar.advance()
    return examples
