"""Recorded grasps with what networks make of them: what figures and recordings of them share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from handsight.evaluation.label_issues import LabelIssue
from handsight.servoing.heatmap import Heatmap
from handsight.servoing.homography import InputGrid
from handsight.servoing.view import View
from handsight.viz.errors import RecordingError
from handsight.viz.pixels import Step, place_heatmap


@dataclass(frozen=True, slots=True, kw_only=True)
class HeatmapExample:
    """A picture and what the network makes of it."""

    view: View
    heatmap: Heatmap
    title: str
    held: bool | None = None
    """The label of the grasp that was attempted from here; None where there is none."""
    grid: InputGrid = field(default_factory=InputGrid)
    jaws_m: float = 0.085
    """Opening of the gripper [m]."""


def heatmap_faults(examples: Sequence[HeatmapExample]) -> list[str]:
    """Why examples cannot be drawn: there are none, or the heatmap of some has no place on its picture."""
    faults = [] if examples else ["there are no examples, expected at least one"]
    for number, example in enumerate(examples):
        try:
            place_heatmap(example.heatmap)
        except RecordingError as error:
            faults.append(f"example {number} ({example.title!r}): {error}")
    return faults


@dataclass(frozen=True, slots=True, kw_only=True)
class LabelIssueExample:
    """A label issue with what is needed to judge it."""

    issue: LabelIssue
    view: View
    """The overhead picture."""
    grasp: Step
    """From where the picture was taken to where the grasp was attempted (dx [m], dy [m], dangle [rad])."""
    inputs: NDArray[np.float16]
    """What the networks read. Shape (4, size, size)."""
    jaws_m: float
    """Opening of the open gripper [m]."""
    widths_m: tuple[float, float, float, float]
    """Openings read before the grasp, after closing, after the lift and at the end; NaN where none was [m]."""
    closed_width_m: float
    """Readings at or below this opening count as fully closed [m]."""
    commands: tuple[str, ...]
    """What to type if the label is wrong or the attempt should not count."""
