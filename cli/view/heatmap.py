"""``handsight view heatmap``: predicted success over recorded pictures, in the Rerun viewer."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from handsight.cli.heatmap import (
    DEFAULT_ANGLES,
    Angles,
    Count,
    Raw,
    Spacing,
    Wrong,
    check_chosen_one_way,
    heatmap_request,
    heatmaps_json,
    heatmaps_of,
)
from handsight.cli.opening import check_out_file, checked_address, open_version
from handsight.cli.options import DEFAULT_THRESHOLD, Dataset, Filter, Ids, Json, Model, Threshold, Where
from handsight.cli.output import console
from handsight.cli.view.showing import Picture, Port, Web, check_way_to_look, show_recording
from handsight.training.run_folder import check_finished_run


def heatmap_command(
    dataset: Dataset,
    model: Model,
    attempts: Ids = None,
    where: Where = "",
    filter_name: Filter = "",
    wrong: Wrong = False,
    count: Count = 8,
    angles: Angles = DEFAULT_ANGLES,
    spacing_px: Spacing = 8,
    threshold: Threshold = DEFAULT_THRESHOLD,
    raw: Raw = False,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE.rrd", help="Keep the recording; else it goes with the viewer.")
    ] = None,
    web: Web = False,
    port: Port = 0,
    picture: Picture = None,
    as_json: Json = False,
) -> None:
    """Look at predicted success over pictures of a dataset, at all angles; 'heatmap' writes the same into a file.

    A tab for each attempt, with the angle on a slider, and one that compares predictions with what happened.
    """
    checked_address(dataset)
    check_finished_run(model)
    if out is not None:
        check_out_file(out)
    check_chosen_one_way(attempts, where, filter_name, wrong=wrong)
    check_way_to_look(web=web, picture=picture)
    from handsight.datasets.held import HeldFolder
    from handsight.viz.recordings.heatmap_layouts import HEAT_TIMELINE
    from handsight.viz.recordings.heatmaps import write_heatmaps

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
    with HeldFolder("handsight-heatmaps-") as folder:
        recording = out if out is not None else folder / "heatmaps.rrd"
        write_heatmaps(recording, made.examples, made.overview)
        if not as_json:
            console.print(f"shown: {made.temperature}")
        told = {**heatmaps_json(made, angles), "recording": out}
        show_recording(recording, told, timeline=HEAT_TIMELINE, web=web, port=port, picture=picture, as_json=as_json)
