"""The seam for whoever watches trials while they run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from handsight.datasets.records import RgbdFrame, SceneObjects, StationSpec
from handsight.servoing.loop import ServoStep

if TYPE_CHECKING:
    from handsight.evaluation.trial import TrialRecording


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialStart:
    """What is known of a trial before its first servo step."""

    method: str
    number: int
    threshold: float
    station: StationSpec
    overhead: RgbdFrame
    scene: SceneObjects | None


class TrialWatcher(Protocol):
    """Is told what happens, one trial after another. It must neither raise nor make anybody wait."""

    def begin(self, start: TrialStart) -> None:
        """A trial has taken its overhead picture and goes to its first pose."""

    def step(self, step: ServoStep) -> None:
        """The loop has looked and chosen; the gripper has yet to move."""

    def end(self, recording: TrialRecording | None) -> None:
        """The grasp was executed; None where the trial was aborted before it."""

    def close(self) -> None:
        """No more trials follow."""


class WatcherFactory(Protocol):
    """Opens a watcher in the process where trials run; must survive pickling."""

    def __call__(self) -> TrialWatcher:
        """Open it."""
