"""Recorded grasps with what networks make of them: what figures and recordings of them share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from handsight.evaluation.foresight import Foresight, ReliabilityRow
from handsight.evaluation.label_issues import LabelIssue
from handsight.evaluation.temperature import Temperature
from handsight.servoing.angle_maps import AngleMaps
from handsight.servoing.heatmap import Heatmap
from handsight.servoing.homography import InputGrid
from handsight.servoing.view import View
from handsight.viz.errors import RecordingError
from handsight.viz.pixels import Step, place_heatmap


@dataclass(frozen=True, slots=True, kw_only=True)
class HeatmapExample:
    """A picture and what the network makes of it."""

    view: View
    maps: AngleMaps
    """Predicted success as it is to be shown: calibrated where ``temperature`` is fitted."""
    title: str
    held: bool | None = None
    """The label of the grasp that was attempted from here; None where there is none."""
    grid: InputGrid = field(default_factory=InputGrid)
    jaws_m: float = 0.085
    """Opening of the gripper [m]."""
    view_plane_m: float | None = None
    """Distance of the plane at the height where grasps begin [m]; None where the picture was taken there."""
    grasp: Step | None = None
    """The grasp that was attempted (dx [m], dy [m], dangle [rad]); None where there was none."""
    foresight: Foresight | None = None
    """What the network says of that grasp, and what happened; None where there is no label."""
    temperature: Temperature = field(default_factory=Temperature)
    threshold: float = 0.95
    """Score of the network, not calibrated, at which grasps are executed."""

    @property
    def heatmap(self) -> Heatmap:
        """The map of the angle at which the best score is."""
        return self.maps.best_map

    @property
    def shown_threshold(self) -> float:
        """The threshold on the scale of what is shown."""
        return float(self.temperature(self.threshold))


@dataclass(frozen=True, slots=True, kw_only=True)
class ForesightOverview:
    """Predicted against happened over many attempts: where the network is wrong."""

    title: str
    wrong: Sequence[Foresight]
    """The attempts that surprise most first."""
    thumbnails: Sequence[NDArray[np.uint8]]
    """A picture of each of the first of them, all of one shape (H, W, 3)."""
    reliability: Sequence[ReliabilityRow]
    attempts: int
    """How many were compared."""
    learnt: int | None
    """How many of them the network learnt from, so that they say little of others; None where that is not known."""
    temperature: Temperature


def heatmap_faults(examples: Sequence[HeatmapExample]) -> list[str]:
    """Why examples cannot be drawn: there are none, or the heatmap of some has no place on its picture."""
    faults = [] if examples else ["there are no examples, expected at least one"]
    for number, example in enumerate(examples):
        try:
            for index in range(len(example.maps.angles_rad)):
                place_heatmap(example.maps.at(index))
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
