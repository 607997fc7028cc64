"""Failed trials of an evaluation, simulated again for their pictures.

A trial depends on its seed and number alone, so that it happens again as it did; where it does not, as with another
version of the simulator, it is left out and that is said.
"""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence
from itertools import zip_longest
from pathlib import Path
from typing import Any

from handsight.cli.output import progress_bar
from handsight.cli.wiring.stations import sim_station
from handsight.collection.errors import CollectionError
from handsight.evaluation.evaluate import TrialContextFactory
from handsight.evaluation.trial import TrialRecording, run_trial
from handsight.servoing.loop import ServoSettings
from handsight.servoing.methods.registry import METHODS
from handsight.training.errors import TrainingError
from handsight.viz.report.content import Block, Note
from handsight.viz.report.trial_gallery import failed_trials


def failure_blocks(run: Path, results: dict[str, Any], most: int) -> Iterator[Block]:
    """A gallery of failed trials, and why others are not in it.

    Args:
        run: Folder of the network that was evaluated.
        results: What ``evaluate --json`` printed, once it was checked.
        most: Trials that are simulated again.
    """
    chosen = _surest(results["trials"], most)
    if not chosen:
        return
    if results.get("disturbance"):
        yield Note(text="The station was disturbed: trials are not simulated again for their pictures.")
        return
    recordings, faults = _replayed(run, results, chosen)
    gallery = failed_trials(
        recordings, text="Of each method those of which the network was surest, simulated again for this page."
    )
    if gallery is not None:
        yield gallery
    if faults:
        yield Note(text=f"Not shown: {'; '.join(faults)}.")


def _surest(trials: Sequence[dict[str, Any]], most: int) -> list[dict[str, Any]]:
    """Failed trials of methods that servo, from method to method in turn, the highest scores first."""
    failed = [
        one
        for one in trials
        if not one["success"] and not one["aborted"] and one["score"] is not None and one["method"] in METHODS
    ]
    ranked: dict[str, list[dict[str, Any]]] = {}
    for one in sorted(failed, key=lambda one: (-one["score"], one["objects"], one["number"])):
        ranked.setdefault(one["method"], []).append(one)
    return [one for turn in zip_longest(*(ranked[name] for name in METHODS if name in ranked)) for one in turn if one][
        :most
    ]


def _call(run: Path, results: dict[str, Any], one: dict[str, Any]) -> str:
    """What shows a trial step by step."""
    words = ["handsight", "servo", "--model", str(run), "--method", one["method"]]
    words += ["--trial", str(one["number"]), "--objects", one["objects"], "--gripper", results["gripper"]]
    words += ["--level"] if results.get("level") else []
    return shlex.join([*words, "--threshold", f"{results['threshold']:g}", "--seed", str(results["seed"])])


def _replayed(
    run: Path, results: dict[str, Any], chosen: Sequence[dict[str, Any]]
) -> tuple[list[tuple[TrialRecording, str]], list[str]]:
    """The trials with everything seen and the calls that show them, and why others could not be had."""
    recordings, faults = [], []
    servo = ServoSettings.from_json(results)
    with progress_bar("failures", len(chosen)) as bar:
        for objects in dict.fromkeys(one["objects"] for one in chosen):
            try:
                station = sim_station(objects, gripper=results["gripper"])
                context = TrialContextFactory(open_station=station, run=run)()
            except (CollectionError, TrainingError) as error:
                faults.append(str(error))
                continue
            try:
                for one in chosen:
                    if one["objects"] == objects:
                        trial, recording = run_trial(
                            context.station,
                            context.scorer,
                            one["method"],
                            one["number"],
                            seed=results["seed"],
                            settings=servo,
                        )
                        if recording is None or trial.success:
                            faults.append(f"trial {one['number']} of {one['method']} ends otherwise here than it did")
                        else:
                            recordings.append((recording, _call(run, results, one)))
                        bar.advance()
            finally:
                context.close()
    return recordings, faults
