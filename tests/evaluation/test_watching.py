"""Whoever watches trials is told of each that servoes, in order, while the gripper has yet to move."""

from __future__ import annotations

from dataclasses import dataclass, field

import torch
from tests.support.scorers import FunctionScorer
from tests.support.scripted_station import ScriptedStation

from handsight.evaluation.trial import TrialRecording, run_trial
from handsight.evaluation.watching import TrialStart
from handsight.servoing.loop import ServoSettings, ServoStep

HALF = FunctionScorer(lambda inputs: torch.full((len(inputs),), 0.5))


@dataclass
class Notes:
    """A watcher that writes down what it is told, and how far the station was then."""

    station: ScriptedStation
    told: list[tuple[str, object]] = field(default_factory=list)
    reached: list[int] = field(default_factory=list)

    def begin(self, start: TrialStart) -> None:
        self.told.append(("begin", start))

    def step(self, step: ServoStep) -> None:
        self.told.append(("step", step))
        self.reached.append(list(self.station.calls).count("reach"))

    def end(self, recording: TrialRecording | None) -> None:
        self.told.append(("end", recording))

    def close(self) -> None:
        self.told.append(("close", None))


def test_a_trial_is_told_from_its_start_to_its_grasp() -> None:
    station = ScriptedStation()
    notes = Notes(station)
    settings = ServoSettings(threshold=0.9)
    _, recording = run_trial(station, HALF, "cem-1", 3, seed=1, settings=settings, watcher=notes)
    assert recording is not None
    names = [name for name, _ in notes.told]
    assert names == ["begin", *["step"] * len(recording.trace.steps), "end"]
    start = notes.told[0][1]
    assert isinstance(start, TrialStart)
    assert (start.method, start.number, start.threshold) == ("cem-1", 3, 0.9)
    assert start.station == recording.station
    assert [step for name, step in notes.told if name == "step"] == list(recording.trace.steps)
    assert notes.told[-1][1] is recording
    # At step k the gripper has made k moves and the one to where servoing began.
    assert notes.reached == [1 + number for number in range(len(recording.trace.steps))]


def test_an_aborted_trial_ends_without_a_recording() -> None:
    station = ScriptedStation(faults={"look": 3})
    notes = Notes(station)
    run_trial(station, HALF, "cem-1", 0, seed=1, settings=ServoSettings(), watcher=notes)
    assert notes.told[0][0] == "begin"
    assert notes.told[-1] == ("end", None)
    assert len(notes.told) > 2


def test_random_grasps_show_nothing() -> None:
    station = ScriptedStation()
    notes = Notes(station)
    run_trial(station, None, "random", 0, seed=1, settings=ServoSettings(), watcher=notes)
    assert notes.told == []
