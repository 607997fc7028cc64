"""A folder as the demo leaves it, made in a moment, and evaluations of trials that nobody ran."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

from tests.support.factories import make_attempt, make_header, record
from tests.support.runs import ORIGIN, save_untrained
from tests.support.swept import OBJECTS
from tests.support.trials import make_trial

from handsight.datasets import GraspDataset, GraspRepository, Outcome
from handsight.evaluation.journal_lines import trial_to_json
from handsight.evaluation.report import evaluation_report

MARKUP = "<img src=x onerror=alert(1)>&\"'{{ 7 * 7 }}"
"""A name that would do something if it were not taken for text."""


def make_evaluation(*, objects: str = "blocks-test", model: str = "run", weights: str = "w" * 64) -> dict[str, Any]:
    """What ``evaluate --json`` prints of twelve trials."""
    trials = [
        make_trial(
            number,
            method,
            success=number % 3 == 0,
            moves=number % 4,
            score=None if method == "random" else 0.55 + 0.07 * number,
            closed_m=0.0,
            contact_force_n=3.0,
            contact_height_m=0.03,
        )
        for method in ("random", "cem-1")
        for number in range(6)
    ]
    report = evaluation_report({objects: trials}, methods=("random", "cem-1"), closed_width_m=0.003, threshold=0.95)
    told = {
        **report,
        "model": model,
        "weights_sha256": weights,
        "trained_on": [ORIGIN.to_json()],
        "gripper": "2f-85",
        "seed": 1_000_000,
        "threshold": 0.95,
        "trials": [{"objects": objects, **trial_to_json(trial)} for trial in trials],
        "disturbance": None,
    }
    plain: dict[str, Any] = json.loads(json.dumps(told))
    return plain


def make_demo(folder: Path) -> Path:
    """A dataset with a release, a run of it, results and a recording."""
    folder.mkdir()
    header = make_header(width=96, height=72, objects=OBJECTS)
    outcomes = [Outcome.HELD if at % 3 == 0 else Outcome.EMPTY for at in range(30)]
    repository = GraspRepository.create(folder / "grasps")
    made = [make_attempt(header, at, outcome=outcome) for at, outcome in enumerate(outcomes)]
    record(repository, header, made, every=30)
    repository.release("v1")
    version = GraspDataset.open(f"{folder / 'grasps'}@v1")
    origin = replace(
        ORIGIN,
        dataset=f"{folder / 'grasps'}@v1",
        ref="v1",
        snapshot=version.snapshot_id,
        digest=version.digest,
        attempts=30,
    )
    save_untrained(folder / "run", origins=(origin,))
    (folder / "results.json").write_text(json.dumps(make_evaluation(model=str(folder / "run"))))
    (folder / "servo_trace.rrd").write_bytes(b"RRF2")
    return folder
