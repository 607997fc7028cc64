"""What ``handsight heatmap`` and ``view heatmap`` record: attempts, their maps, predicted against happened."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import torch
from numpy.typing import NDArray

from handsight.cli.errors import CommandError
from handsight.cli.output import progress_bar
from handsight.datasets.format.decisions import trainable
from handsight.datasets.format.saved_filters import read_filters
from handsight.datasets.format.schema import parse_attempt_id
from handsight.datasets.inputs.materialize import materialize
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.reading.selection import expressions, matches
from handsight.datasets.records import RgbdFrame
from handsight.datasets.views import grasp_plane_m, station_view
from handsight.evaluation.foresight import (
    Foresight,
    calibrate,
    foresights,
    learnt_from,
    most_wrong,
    reliability_rows,
    scores_at_grasps,
)
from handsight.evaluation.temperature import Temperature
from handsight.servoing.angle_maps import angle_maps
from handsight.servoing.planar import PlanarPose
from handsight.servoing.scorer import GraspScorer
from handsight.training.run import TrainedRun, load_run
from handsight.viz import palette
from handsight.viz.examples import ForesightOverview, HeatmapExample
from handsight.viz.pixels import CENTRE_PX, PictureFrame, Step, jaw_strips

MANY = 1000
"""Attempts from which on inputs are made once and kept, as for training."""
SHEET = 12
"""Pictures of the overview."""
_BATCH = 512


@dataclass(frozen=True, slots=True, kw_only=True)
class HeatmapRequest:
    """Which attempts of a version, and how their maps are made."""

    attempts: tuple[str, ...] = ()
    """Ids; empty for the latest, or the most wrong, of those that match."""
    where: str = ""
    filter: str = ""
    wrong: bool = False
    """Whether to take the attempts about which the network is most wrong, not the latest."""
    count: int = 8
    angles: int = 18
    spacing_px: int = 8
    threshold: float = 0.95
    raw: bool = False
    """Whether scores are shown as the network gives them, although they could be calibrated."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Heatmaps:
    """What is to be recorded."""

    examples: tuple[HeatmapExample, ...]
    overview: ForesightOverview | None
    """None where no two attempts with a label were compared."""
    attempts: tuple[str, ...]
    temperature: Temperature
    compared: tuple[Foresight, ...]
    """The attempts compared with what happened, the most wrong first."""


def make_heatmaps(dataset: GraspDataset, model: Path, request: HeatmapRequest) -> Heatmaps:
    """Choose attempts and score their pictures, behind progress bars.

    Raises:
        CommandError: No attempt matches.
        WhereError: An expression is not sound, or there is no such filter.
        ServoSettingsError: Angles or spacing are out of range.
    """
    run = load_run(model)
    temperature = Temperature(source="as asked for") if request.raw else calibrate(run, dataset)
    matching = _matching(dataset, request)
    labelled = _labelled(dataset, matching)
    if request.wrong and not labelled:
        raise CommandError("none of these attempts has a label to compare predictions with, expected some; name others")
    latest = matching if request.attempts else matching[-request.count :]
    asked = labelled if request.wrong else _labelled(dataset, latest)
    scorer = run.scorer()
    seen = most_wrong(foresights(dataset, asked, _scores(scorer, dataset, asked), temperature))
    chosen = tuple(one.attempt for one in seen[: request.count]) if request.wrong else tuple(latest)
    by_attempt = {one.attempt: one for one in seen}
    examples = _examples(dataset, run, chosen, request, temperature, by_attempt)
    return Heatmaps(
        examples=examples,
        overview=_overview(dataset, seen, temperature, learnt_from(run, dataset)) if len(seen) > 1 else None,
        attempts=chosen,
        temperature=temperature,
        compared=tuple(seen),
    )


def _matching(dataset: GraspDataset, request: HeatmapRequest) -> list[str]:
    """Attempts with an overhead picture that are asked for, in the order of the table, or as they were named."""
    if request.attempts:
        return list(request.attempts)
    table = dataset.attempts
    chosen = table["overhead_taken"].to_numpy(dtype=bool, copy=True)
    for where in expressions(request.where, request.filter, read_filters(dataset.root) if request.filter else {}):
        chosen &= matches(table, where).to_numpy(dtype=bool)
    ids = [str(key) for key in table.index[chosen]]
    if not ids:
        raise CommandError(
            "no attempt with an overhead picture matches, expected at least one; see 'handsight dataset ls --help' for "
            "what there is"
        )
    return ids


def _labelled(dataset: GraspDataset, ids: Sequence[str]) -> list[str]:
    rows = dataset.attempts.loc[list(ids)]
    usable = trainable(rows).to_numpy(dtype=bool) & rows["overhead_taken"].to_numpy(dtype=bool)
    return [one for one, good in zip(ids, usable, strict=True) if good]


def _scores(scorer: GraspScorer, dataset: GraspDataset, ids: Sequence[str]) -> NDArray[np.float32]:
    """Predicted success of the grasps that were executed. Shape (N,)."""
    with progress_bar("predict", len(ids)) as bar:
        if len(ids) < MANY:
            return scores_at_grasps(scorer, dataset, ids, on_attempt=bar.advance)
        data = materialize(dataset, grid=scorer.grid, on_attempt=bar.advance)
        rows = data.attempts.index.get_indexer(pd.Index(ids))
        with torch.no_grad():
            batches = [
                scorer(torch.from_numpy(data.inputs[rows[start : start + _BATCH]].astype(np.float32)))
                for start in range(0, len(rows), _BATCH)
            ]
        return torch.cat(batches).numpy(force=True)


def _examples(
    dataset: GraspDataset,
    run: TrainedRun,
    chosen: Sequence[str],
    request: HeatmapRequest,
    temperature: Temperature,
    seen: dict[str, Foresight],
) -> tuple[HeatmapExample, ...]:
    scorer, examples = run.scorer(), []
    with progress_bar("heatmaps", len(chosen)) as bar:
        for key, frame in dataset.frames("overhead", chosen):
            spec = dataset.station(key)
            view = station_view(frame, spec)
            view_plane_m = grasp_plane_m(view, frame, spec)
            maps = angle_maps(
                view, scorer, angles=request.angles, spacing_px=request.spacing_px, view_plane_m=view_plane_m
            )
            examples.append(
                HeatmapExample(
                    title=_title(dataset, key),
                    view=view,
                    maps=replace(maps, scores=temperature(maps.scores)),
                    held=seen[key].held if key in seen else None,
                    grid=run.grid,
                    jaws_m=spec.gripper_stroke_m,
                    view_plane_m=view_plane_m,
                    grasp=_grasp(dataset, key, frame),
                    foresight=seen.get(key),
                    temperature=temperature,
                    threshold=request.threshold,
                )
            )
            bar.advance()
    return tuple(examples)


def _title(dataset: GraspDataset, attempt: str) -> str:
    """Target and number, which people can read and tell apart."""
    target = dataset.attempts.at[attempt, "target"]
    _, number = parse_attempt_id(attempt)
    return f"{target.rpartition('/')[2]} {number}" if isinstance(target, str) and target else f"attempt {number}"


def _grasp(dataset: GraspDataset, attempt: str, frame: RgbdFrame) -> Step | None:
    names = ["pregrasp_x_m", "pregrasp_y_m", "pregrasp_angle_rad"]
    pose = dataset.rows([attempt], names).loc[attempt, names].to_numpy(dtype=np.float64)
    if not np.isfinite(pose).all():
        return None
    goal = PlanarPose(x_m=float(pose[0]), y_m=float(pose[1]), angle_rad=float(pose[2]))
    step = PlanarPose.from_pose_base_tool(frame.pose_base_tool).step_to(goal)
    return step.dx_m, step.dy_m, step.dangle_rad


def _overview(
    dataset: GraspDataset, seen: Sequence[Foresight], temperature: Temperature, learnt: frozenset[str] | None
) -> ForesightOverview:
    worst = seen[:SHEET]
    thumbnails = [
        _thumbnail(dataset, one, frame)
        for one, (_, frame) in zip(worst, dataset.frames("overhead", [one.attempt for one in worst]), strict=True)
    ]
    return ForesightOverview(
        title="Predicted against happened",
        wrong=seen,
        thumbnails=thumbnails,
        reliability=reliability_rows(seen),
        attempts=len(seen),
        learnt=None if learnt is None else sum(one.attempt in learnt for one in seen),
        temperature=temperature,
    )


def _thumbnail(dataset: GraspDataset, one: Foresight, frame: RgbdFrame) -> NDArray[np.uint8]:
    """Half the picture's size, with the grasp that was attempted. (H / 2, W / 2, 3)."""
    spec = dataset.station(one.attempt)
    view = station_view(frame, spec)
    picture = view.rgb.copy()
    grasp = _grasp(dataset, one.attempt, frame)
    if grasp is not None:
        placed = PictureFrame(camera=view.camera, plane_m=view.plane_m)
        strips = jaw_strips(placed, grasp, spec.gripper_stroke_m, dashed=not one.held)
        lines = [np.rint(strip - CENTRE_PX).astype(np.int32) for strip in strips]
        colour = palette.HELD if one.held else palette.EMPTY
        for width_px, ink in ((9, palette.OUTLINE), (5, colour)):
            cv2.polylines(picture, lines, False, ink, width_px, cv2.LINE_AA)
    half = cv2.resize(picture, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    return np.asarray(half, dtype=np.uint8)
