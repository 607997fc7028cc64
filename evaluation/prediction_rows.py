"""Tables of how wrong predicted inputs are: by the size of the step, and by the height of the object at the grasp."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Final, TypedDict

import numpy as np

from handsight.datasets.errors import counted
from handsight.evaluation.prediction_survey import EDGES, Kind, PredictionSample, SceneSurvey

HEIGHT_EDGES_M: Final = (0.0, 0.01, 0.03, 0.06, math.inf)
"""Ends of the bins of heights: bare table and pens, flat things, most things, tall ones."""
UNIT: Final[dict[Kind, float]] = {"move": 1e3, "turn": 180 / math.pi}
"""What sizes are multiplied with in tables: distances are in millimetres, angles in degrees."""


class PredictionRow(TypedDict):
    """The steps of one size to objects of one height; values are means over them but where it is said."""

    kind: str
    """``move`` or ``turn``."""
    low: float
    """Least size of the steps [mm] or [deg]."""
    high: float
    """Sizes are below this."""
    height_low_mm: float | None
    """Least height of the object at the grasp; None for the row over all heights."""
    height_high_mm: float | None
    """Heights are below this; None where there is no end."""
    steps: int
    colour_rms: float
    """Error of the input's colours, which are in [0, 1]: root mean square over its pixels."""
    height_rms_mm: float
    """The same of its heights."""
    extrapolated: float
    """Share of its pixels outside the picture that it was predicted from."""
    occluded: float
    """Share that is wrong because an object hides it or shows a face."""
    displaced: float
    """Share that is wrong in depth for no such reason."""
    score_bias: float
    """Predicted less true score: positive where the prediction promises too much."""
    score_error: float
    """Size of that difference."""
    score_error_90: float
    """Nine of ten differences are no larger."""
    score_error_se: float
    """Standard error of their mean; every step of a row is of another scene."""
    points_height_rms_mm: float
    """As ``height_rms_mm``, where the point cloud predicts."""
    points_score_error: float
    """As ``score_error``, where the point cloud predicts."""


def prediction_rows(scenes: Iterable[SceneSurvey]) -> list[PredictionRow]:
    """For each bin of sizes a row over all heights and one for each bin of heights, those that hold steps."""
    samples = [sample for scene in scenes for sample in scene.samples]
    rows: list[PredictionRow] = []
    for kind, edges in EDGES.items():
        for low, high in pairwise(edges):
            of_size = [one for one in samples if one.kind == kind and low <= one.size < high]
            ends = (UNIT[kind] * low, UNIT[kind] * high)
            if of_size:
                rows.append(_row(of_size, kind, ends, (None, None)))
            for least_m, most_m in pairwise(HEIGHT_EDGES_M):
                if some := [one for one in of_size if least_m <= _height_m(one) < most_m]:
                    rows.append(_row(some, kind, ends, (1e3 * least_m, None if math.isinf(most_m) else 1e3 * most_m)))
    return rows


def why_nothing_was_seen(scenes: Sequence[SceneSurvey]) -> str | None:
    """What kept every scene from being looked at, by its first failure; None where there is a sample."""
    if any(scene.samples for scene in scenes):
        return None
    reasons = [scene.failure for scene in scenes if scene.failure] or ["every step began out of reach"]
    return (
        f"no step was compared in {counted(len(scenes), 'scene')}, expected at least one: {reasons[0]}; mend the "
        "station or the network, and try again"
    )


def _height_m(sample: PredictionSample) -> float:
    """Depth is rounded, so that a bare table may be a millimetre low."""
    return max(sample.height_m, 0.0)


def _row(
    samples: list[PredictionSample],
    kind: Kind,
    ends: tuple[float, float],
    heights_mm: tuple[float | None, float | None],
) -> PredictionRow:
    errors = [sample.error for sample in samples]
    sizes = np.abs([error.score_error for error in errors])
    return PredictionRow(
        kind=kind,
        low=round(ends[0], 6),
        high=round(ends[1], 6),
        height_low_mm=heights_mm[0],
        height_high_mm=heights_mm[1],
        steps=len(samples),
        colour_rms=float(np.mean([error.colour_rms for error in errors])),
        height_rms_mm=1e3 * float(np.mean([error.height_rms_m for error in errors])),
        extrapolated=float(np.mean([error.faults.extrapolated for error in errors])),
        occluded=float(np.mean([error.faults.occluded for error in errors])),
        displaced=float(np.mean([error.faults.displaced for error in errors])),
        score_bias=float(np.mean([error.score_error for error in errors])),
        score_error=float(sizes.mean()),
        score_error_90=float(np.quantile(sizes, 0.9)),
        score_error_se=float(sizes.std() / math.sqrt(len(sizes))),
        points_height_rms_mm=1e3 * float(np.mean([error.points_height_rms_m for error in errors])),
        points_score_error=float(np.mean([abs(error.points_score_error) for error in errors])),
    )
