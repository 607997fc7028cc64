"""What ``handsight dataset repeat`` performs again in simulation, and how its table looks on the screen."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
import pandas as pd

from handsight.cli.errors import CommandError
from handsight.cli.output import console, progress_bar
from handsight.cli.tables import Column, print_prose, print_table
from handsight.cli.wiring.evaluation_tables import interval
from handsight.cli.wiring.resimulate import open_recorded_station, why_not_again
from handsight.datasets.errors import counted
from handsight.datasets.format.schema import parse_attempt_id
from handsight.datasets.format.scores import SCORE_PREFIX
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.reading.selection import matches
from handsight.evaluation.repeatability import (
    RecordedGrasp,
    RepeatedGrasp,
    RepeatSettings,
    foreseeable_auc,
    repeat_grasps,
    repeatability_rows,
)
from handsight.servoing.planar import PlanarPose
from handsight.training.metrics import evaluate_scores


def recorded_grasps(dataset: GraspDataset, count: int, *, where: str, seed: int) -> list[RecordedGrasp]:
    """Attempts to perform again, drawn at random: as many successes as failures where there are enough of both.

    Raises:
        WhereError: The expression is not sound.
        CommandError: There is none that can be performed here.
    """
    table = dataset.attempts
    wanted = table[table["recorded_success"].notna() & ~table["excluded"]]
    if where:
        wanted = wanted[matches(wanted, where)]
    why_not = {key: why_not_again(dataset.session(key).header) for key in wanted["session"].unique()}
    reasons = wanted["session"].map(why_not)
    able = wanted[reasons == ""]
    if able.empty:
        which = f"for which --where {where!r} holds " if where else ""
        found = Counter(reasons)
        said = "; ".join(f"{often} {reason}" for reason, often in found.most_common()) or "there is none"
        raise CommandError(
            f"no attempt {which}can be performed again, expected labelled ones of a simulated session: {said}"
        )
    return [_grasp(dataset, able, attempt) for attempt in _drawn(able["recorded_success"], count, seed)]


def repeat_recorded(dataset: GraspDataset, grasps: Sequence[RecordedGrasp], settings: RepeatSettings) -> dict[str, Any]:
    """Perform them again behind a progress bar; returns what ``dataset repeat --json`` prints."""
    with progress_bar("repeat", len(grasps)) as bar:
        done = repeat_grasps(open_recorded_station, grasps, settings, on_grasp=lambda _: bar.advance())
    return {
        "rows": repeatability_rows(done),
        "auc": foreseeable_auc(done),
        "scores": _scores(dataset, done),
        "snapshot": dataset.snapshot_id,
        "repeats": settings.repeats,
        "shift_mm": settings.shift_m * 1e3,
        "turn_deg": math.degrees(settings.turn_rad),
        "seed": settings.seed,
        "attempts": [asdict(one) for one in done],
    }


def print_repeats(results: dict[str, Any]) -> None:
    """The table, and what a network of the dataset's scores makes of the same attempts."""
    cells = [
        (
            row["recorded"],
            str(row["attempts"]),
            f"{row['as_recorded']}/{row['repeats']}",
            "-" if row["rate"] is None else f"{row['rate']:.1%}",
            f"{row['always']}/{row['attempts']}",
            interval(row["always_ci95"]),
            str(row["not_grasped"]),
        )
        for row in results["rows"]
    ]
    columns = (
        "recorded",
        "attempts",
        Column(heading="as recorded", rank=1),
        "rate",
        "always",
        Column(heading="95 % interval", rank=2),
        Column(heading="not grasped", rank=3),
    )
    print_table(columns, cells)
    often = counted(results["repeats"], "repeat")
    console.print(f"{often} of each, {results['shift_mm']:g} mm and {results['turn_deg']:g} deg beside it")
    if results["auc"] is not None:
        scores = "".join(f"; {name} {auc:.3f}" for name, auc in results["scores"].items() if auc is not None)
        print_prose(f"AUC of the share of repeats that held: {results['auc']:.3f}{scores}")


def _drawn(held: pd.Series[bool], count: int, seed: int) -> list[str]:
    """Ids in the order of the table; where one label has fewer than half, more of the other."""
    shuffled = held.sample(frac=1, random_state=np.random.default_rng(seed)).astype(bool)
    successes, failures = shuffled.index[shuffled], shuffled.index[~shuffled]
    of_failures = min(len(failures), max(count // 2, count - len(successes)))
    chosen = {*failures[:of_failures], *successes[: count - of_failures]}
    return [attempt for attempt in held.index if attempt in chosen]


def _grasp(dataset: GraspDataset, table: pd.DataFrame, attempt: str) -> RecordedGrasp:
    header = dataset.session(attempt).header
    _, number = parse_attempt_id(attempt)
    x_m, y_m, angle_rad = (float(table[f"pregrasp_{name}"][attempt]) for name in ("x_m", "y_m", "angle_rad"))
    return RecordedGrasp(
        attempt=attempt,
        number=number,
        session_seed=header.seed or 0,  # Those without were left out.
        station=header.config["station"],
        pose=PlanarPose(x_m=x_m, y_m=y_m, angle_rad=angle_rad),
        held=bool(table.loc[attempt, "recorded_success"]),
    )


def _scores(dataset: GraspDataset, done: Sequence[RepeatedGrasp]) -> dict[str, float | None]:
    """How well each network whose scores are stored tells the same attempts apart; see ``dataset score``."""
    table = dataset.attempts.loc[[one.attempt for one in done]]
    found = {}
    for column in [name for name in table.columns if str(name).startswith(SCORE_PREFIX)]:
        known = table[table[column].notna()]
        values = known[column].to_numpy(np.float32)
        found[column] = evaluate_scores(values, known["recorded_success"].to_numpy(np.float32)).auc
    return found
