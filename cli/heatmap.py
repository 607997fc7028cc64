"""``handsight heatmap``: predicted success over recorded pictures, at all angles (figure 8)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from handsight.cli.errors import CommandError
from handsight.cli.opening import check_out_file, checked_address, open_version
from handsight.cli.options import DEFAULT_THRESHOLD, MOST_ATTEMPTS, Dataset, Filter, Ids, Json, Model, Threshold, Where
from handsight.cli.output import bold, console, print_json
from handsight.datasets.errors import counted, pasteable
from handsight.training.run_folder import check_finished_run

if TYPE_CHECKING:
    # PyTorch and Rerun take seconds; nothing is imported where there is no dataset or no run.
    from handsight.cli.wiring.heatmaps import HeatmapRequest, Heatmaps
    from handsight.datasets.reading.reader import GraspDataset

COLUMNS = 4
"""Examples in one picture."""
DEFAULT_ANGLES = 18
MOST_ANGLES = 180
"""``angle_maps.MOST_ANGLES`` is this too, and a test that they agree."""

Count = Annotated[
    int, typer.Option("--count", "-n", min=1, max=MOST_ATTEMPTS, help="How many attempts, where no ids are given.")
]
Angles = Annotated[
    int, typer.Option("--angles", min=1, max=MOST_ANGLES, help="Angles over half a turn; one is that of the picture.")
]
Spacing = Annotated[int, typer.Option("--spacing", min=1, max=10_000, help="Pixels between the points of a map.")]
Wrong = Annotated[
    bool, typer.Option("--wrong", help="Those of which the network was most wrong, not the latest, of all that match.")
]
Raw = Annotated[bool, typer.Option("--raw", help="Show scores as the network gives them, without calibrating them.")]


def heatmap_command(
    dataset: Dataset,
    model: Model,
    attempts: Ids = None,
    out: Annotated[Path, typer.Option("--out", help="Recording to write, for 'rerun FILE'.")] = Path("heatmaps.rrd"),
    where: Where = "",
    filter_name: Filter = "",
    wrong: Wrong = False,
    count: Count = 8,
    angles: Angles = DEFAULT_ANGLES,
    spacing_px: Spacing = 8,
    threshold: Threshold = DEFAULT_THRESHOLD,
    raw: Raw = False,
    picture: Annotated[
        Path | None,
        typer.Option("--picture", metavar="FILE.png", help=f"Draw the first {COLUMNS} side by side, for a document."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Record predicted success over the overhead pictures of a dataset, at all angles.

    A tab for each attempt, with the angle on a slider, and one that compares predictions with what happened. Scores are
    calibrated by the attempts that the run held out; the recording says which are shown.
    """
    checked_address(dataset)
    check_finished_run(model)
    check_out_file(out)
    check_chosen_one_way(attempts, where, filter_name, wrong=wrong)
    from handsight.viz.figures.montage import montage_figure
    from handsight.viz.figures.style import check_figure_path
    from handsight.viz.recordings.heatmaps import write_heatmaps

    if picture is not None:
        check_figure_path(picture, ".png")
    opened = open_version(dataset)
    request = heatmap_request(
        opened,
        attempts,
        where=where,
        filter_name=filter_name,
        wrong=wrong,
        count=count,
        angles=angles,
        spacing_px=spacing_px,
        threshold=threshold,
        raw=raw,
    )
    made = heatmaps_of(opened, model, request)
    write_heatmaps(out, made.examples, made.overview)
    if picture is not None:
        montage_figure(picture, made.examples[:COLUMNS])
    if as_json:
        print_json({**heatmaps_json(made, angles), "recording": out, "picture": picture})
        return
    console.print(
        bold(out),
        f": {counted(angles, 'angle')} of {counted(len(made.attempts), 'attempt')}; open it with "
        f"{pasteable('rerun', out)}",
    )
    console.print(f"shown: {made.temperature}")
    if picture is not None:
        console.print(bold(picture), f": the first {len(made.examples[:COLUMNS])} of them")


def check_chosen_one_way(attempts: list[str] | None, where: str, filter_name: str, *, wrong: bool) -> None:
    """Refuse ids beside what would choose others.

    Raises:
        CommandError: Both are given.
    """
    others = [option for option, given in (("--where", where), ("--filter", filter_name), ("--wrong", wrong)) if given]
    if attempts and others:
        raise CommandError(f"attempts are named, and {' and '.join(others)} would choose others: leave one of them out")


def heatmap_request(
    opened: GraspDataset,
    attempts: list[str] | None,
    *,
    where: str,
    filter_name: str,
    wrong: bool,
    count: int,
    angles: int,
    spacing_px: int,
    threshold: float,
    raw: bool,
) -> HeatmapRequest:
    """The options of the command, with ids written out.

    Raises:
        AttemptNotFoundError: An id is none of this version.
    """
    from handsight.cli.wiring.heatmaps import HeatmapRequest
    from handsight.datasets.reading.attempt_ids import resolve_attempt_ids
    from handsight.servoing.loop import ServoSettings

    return HeatmapRequest(
        attempts=tuple(resolve_attempt_ids(opened, attempts)) if attempts else (),
        where=where,
        filter=filter_name,
        wrong=wrong,
        count=count,
        angles=angles,
        spacing_px=spacing_px,
        threshold=ServoSettings(threshold=threshold).threshold,
        raw=raw,
    )


def heatmaps_of(opened: GraspDataset, model: Path, request: HeatmapRequest) -> Heatmaps:
    """The maps asked for; see :func:`~handsight.cli.wiring.heatmaps.make_heatmaps`."""
    from handsight.cli.wiring.heatmaps import make_heatmaps

    return make_heatmaps(opened, model, request)


def heatmaps_json(made: Heatmaps, angles: int) -> dict[str, object]:
    """What ``--json`` says of them."""
    return {
        "attempts": made.attempts,
        "angles": angles,
        "calibrated": made.temperature.fitted,
        "temperature": made.temperature.value if made.temperature.fitted else None,
        "shown": str(made.temperature),
        "compared": made.compared,
    }
