"""What became of a day of an unattended rig, from the files that it left."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tests.support.rig_files import RIG
from tests.support.rig_person import stayed_inside

from handsight.collection.ur10.rig import WorkspaceConfig
from handsight.datasets import GraspDataset

LABELLED = {"HELD": True, "EMPTY": False}


def report(folder: Path, lives: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Figures of a run; ``wrong`` has what must not have happened."""
    told, day, log = (_lines(folder / name) for name in ("attempts.jsonl", "day.jsonl", "operator_log.jsonl"))
    ended = [one for one in day if one["what"] == "collector ended"]
    hours = sum(one["clock_s"] for one in lives) / 3600
    # Nobody knows what was held where the emulator was killed in the moment of the reading.
    labelled = [one for one in told if one["outcome"] in LABELLED and one["held"] is not None]
    wrong = [
        f"attempt {one['number']} is {one['outcome']}, held: {one['held']}"
        for one in labelled
        if LABELLED[one["outcome"]] != one["held"]
    ]
    mislabelled = len(wrong)
    kept = _kept(folder / "grasps")
    lost = Counter(one["number"] for one in told) - kept
    wrong += [f"attempt {number} was told of and is not kept" for number in sorted(lost.elements())]
    wrong += [f"the collector hung in life {one['life']}" for one in day if one["what"] == "hung"]
    wrong += [
        f"the fingertips were between {low} and {high}"
        for low, high in _boxes(lives)
        if not stayed_inside(workspace(), (low, high))
    ]
    return {
        "robot_hours": round(hours, 2),
        "attempts": len(told),
        "kept": kept.total(),
        "per_robot_hour": round(len(told) / max(hours, 1e-9), 1),
        "outcomes": dict(Counter(one["outcome"] for one in told)),
        "lost_after_the_label": sum(one["held"] is True and one.get("held_later") is False for one in labelled),
        "labels_against_physics": f"{len(labelled)} labels, {mislabelled} faults",
        "aborted_by": dict(Counter(_cause(one["failure"]) for one in told if one["failure"]).most_common()),
        "faults_of_the_rig": dict(Counter(fired["name"] for one in lives for fired in one["fired"]).most_common()),
        "faults_of_machines": dict(Counter(one["fault"] for one in day if one["what"] == "harm").most_common()),
        "recoveries": sum(one["what"] == "recovered" for one in log),
        "pauses": dict(Counter(_cause(one["paused"]) for one in ended if one["paused"]).most_common()),
        "lives_of_the_emulator": len(lives),
        "ends_of_the_collector": dict(Counter(str(one["status"]) for one in ended)),
        "lowest_m": round(min(low[2] for low, _ in _boxes(lives)), 4),
        "wrong": wrong,
    }


def _kept(path: Path) -> Counter[int]:
    """How many attempts of each number are in a dataset, in all sessions; none where the run never came to begin it."""
    if not path.exists():
        return Counter()
    return Counter(int(number) for number in GraspDataset.open(str(path)).attempts["number"])


def _lines(path: Path) -> list[dict[str, Any]]:
    if not path.exists():
        return []
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def _cause(text: str) -> str:
    """A message without its numbers, addresses and paths."""
    text = re.sub(r"/\S+/", "", text.partition(";")[0])
    return re.sub(r"[0-9][0-9.]*", "N", text)[:110]


def _boxes(lives: Sequence[dict[str, Any]]) -> list[tuple[list[float], list[float]]]:
    return [(one["travelled_m"][0], one["travelled_m"][1]) for one in lives]


def workspace() -> WorkspaceConfig:
    """Of the rigs of tests."""
    values = dict(re.findall(r"([xy]_(?:min|max)_m) = (\S+)", RIG))
    return WorkspaceConfig(**{name: float(value) for name, value in values.items()})
