"""What ``handsight evaluate`` and the demo evaluate: a run on object sets, perhaps with a journal to go on from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from handsight.cli.errors import CommandError
from handsight.cli.options import DEFAULT_GRIPPER
from handsight.cli.output import progress_bar
from handsight.cli.wiring.stations import sim_station
from handsight.collection.collector import StationFactory
from handsight.collection.errors import ObjectSetError
from handsight.collection.sim.station import SimStationFactory
from handsight.collection.ur10.station_factory import Ur10StationFactory
from handsight.evaluation.disturbance import Disturbance, DisturbedFactory
from handsight.evaluation.evaluate import EvaluationSettings, TrialContextFactory, evaluate
from handsight.evaluation.journal import Journal, perhaps_journal
from handsight.evaluation.journal_lines import TRIALS, trial_to_json
from handsight.evaluation.one_look import loop_report
from handsight.evaluation.report import evaluation_report
from handsight.evaluation.trial import Trial
from handsight.evaluation.watching import WatcherFactory
from handsight.jobs.engine import LOCAL, Engine
from handsight.servoing.methods.registry import METHODS
from handsight.training.run import load_run

RIG = "rig"
"""What stands for the object set where a rig is evaluated: nobody knows what lies on its table."""


def object_sets(text: str, *, gripper: str = DEFAULT_GRIPPER) -> dict[str, SimStationFactory]:
    """Stations over the comma-separated sets of ``--objects``, each once, in the order given.

    Raises:
        ObjectSetError: Some cannot be used; all of them are named.
        CommandError: None is given.
    """
    names = dict.fromkeys(name.strip() for name in text.split(",") if name.strip())
    if not names:
        raise CommandError(f"--objects is {text!r}, expected names of object sets with commas between them")
    stations, faults = {}, []
    for name in names:
        try:
            stations[name] = sim_station(name, gripper=gripper)
        except ObjectSetError as error:
            faults.append(str(error))
    if faults:
        raise ObjectSetError("; ".join(faults))
    return stations


def evaluate_model(
    model: Path,
    objects: str,
    settings: EvaluationSettings,
    *,
    gripper: str = DEFAULT_GRIPPER,
    out: Path | None = None,
    against: str | None = None,
    disturbance: Disturbance | None = None,
    watch: WatcherFactory | None = None,
    engine: Engine = LOCAL,
    rig: Ur10StationFactory | None = None,
) -> dict[str, Any]:
    """Run the trials behind a progress bar; returns what ``evaluate --json`` prints.

    Args:
        model: Folder of the run.
        objects: Names of object sets, with commas between them.
        settings: What to compare on each of them.
        gripper: Name of the gripper.
        out: Journal to begin or to go on with.
        against: Reference of the comparisons.
        disturbance: What is wrong with the stations; each method is then tried with one look too.
        watch: Who watches the trials of each worker.
        engine: Where the workers run.
        rig: A real rig, which takes the place of all object sets.

    Raises:
        ObjectSetError: Sets that cannot be used.
        JournalError: The journal is one of another evaluation, or none.
    """
    plain: dict[str, StationFactory] = {}
    if rig is None:
        plain.update(object_sets(objects, gripper=gripper))
    else:
        plain[RIG] = rig
        gripper = rig.rig.gripper.model
    stations: dict[str, StationFactory] = {
        name: station if disturbance is None else DisturbedFactory(open_station=station, disturbance=disturbance)
        for name, station in plain.items()
    }
    run = load_run(model)
    decides = {
        "weights_sha256": run.weights_sha256,
        "seed": settings.seed,
        **settings.servo.to_json(),
        "methods": {name: METHODS[name].to_json() for name in settings.methods},
        "objects": {name: station.settings() for name, station in stations.items()},
    }
    factories = {
        name: TrialContextFactory(open_station=station, run=model, weights_sha256=run.weights_sha256, watch=watch)
        for name, station in stations.items()
    }
    servoing = tuple(name for name in settings.methods if METHODS[name].settings is not None)
    with perhaps_journal(out, TRIALS, decides) as journal:
        trials = _run_trials(factories, settings, journal, engine)
        opened: dict[str, Sequence[Trial]] = {}
        if disturbance is not None and servoing:
            opened = _run_trials(factories, replace(settings, one_look=True, methods=servoing), journal, engine)
    report = evaluation_report(
        trials,
        methods=settings.methods,
        closed_width_m=next(iter(stations.values())).spec.closed_width_m,
        threshold=settings.servo.threshold,
        against=against,
    )
    return {
        **report,
        "model": str(model),
        "weights_sha256": run.weights_sha256,
        "trained_on": [origin.to_json() for origin in run.origins],
        "gripper": gripper,
        "seed": settings.seed,
        "threshold": settings.servo.threshold,
        "level": settings.servo.level,
        "methods": [METHODS[name].to_json() for name in settings.methods],
        "trials": [{"objects": name, **trial_to_json(trial)} for name, some in trials.items() for trial in some],
        "disturbance": None if disturbance is None else str(disturbance),
        "one_look": loop_report(trials, opened, methods=servoing),
    }


def _run_trials(
    factories: dict[str, TrialContextFactory],
    settings: EvaluationSettings,
    journal: Journal[Trial] | None,
    engine: Engine,
) -> dict[str, Sequence[Trial]]:
    """The trials of each object set, those that the journal holds taken from there."""
    each = settings.trials * len(settings.methods)
    trials: dict[str, Sequence[Trial]] = {}
    with progress_bar("one look" if settings.one_look else "evaluate", each * len(factories)) as bar:
        for place, (name, factory) in enumerate(factories.items()):
            page = f"{name}, one look" if settings.one_look else name
            known = [] if journal is None else journal.known(page)
            bar.reached(each * place + sum(trial.number < settings.trials for trial in known))

            def on_trial(trial: Trial, page: str = page) -> None:
                if journal is not None:
                    journal.append(page, trial)
                bar.advance()

            trials[name] = evaluate(factory, settings, known=known, engine=engine, on_trial=on_trial)
    return trials
