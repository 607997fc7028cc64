from __future__ import annotations

import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pytest

from handsight.datasets.inputs.augmentation import Jitter
from handsight.training.errors import TrainerSettingsError
from handsight.training.gqn import GqnConfig
from handsight.training.recipe_file import read_recipe
from handsight.training.settings import TrainSettings

FOUND = TrainSettings(
    network=GqnConfig(channels="depth"), batch=57, learning_rate=3e-3, jitter=Jitter(turn_rad=0.05), balance=True
)


def written(path: Path, **changes: Any) -> Path:
    settings = {**asdict(FOUND), "network": FOUND.network.to_json(), **changes}
    path.write_text(json.dumps({"number": 3, "settings": settings}))
    return path


def test_a_recipe_is_read_as_it_was_found_but_for_weights_of_classes_and_the_seed(tmp_path: Path) -> None:
    assert read_recipe(written(tmp_path / "best.json"), seed=8) == replace(FOUND, balance=False, seed=8)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("{", "it is no JSON"),
        ('{"settings": {"batch": NaN}}', "NaN is no number"),
        ("[]", "settings is missing"),
        ('{"number": 3}', "settings is missing"),
        ("[" * 100_000, "it is no JSON"),
        (b"\xff", "it is no JSON"),
        (" " * (1 << 20) + "{}", "expected at most 1048576"),
    ],
)
def test_what_is_no_recipe_is_refused(tmp_path: Path, content: str | bytes, said: str) -> None:
    path = tmp_path / "best.json"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(TrainerSettingsError, match=said):
        read_recipe(path, seed=0)


def test_every_fault_of_the_settings_is_named(tmp_path: Path) -> None:
    path = written(tmp_path / "best.json", batch="57", epochs=2.5, mood="good", network={"channels": "hsv"})
    with pytest.raises(TrainerSettingsError) as refused:
        read_recipe(path, seed=0)
    for part in ("settings.batch", "settings.epochs", "'mood'", "channels is 'hsv'", "handsight tune --help"):
        assert part in str(refused.value)
    with pytest.raises(TrainerSettingsError, match="learning rate is 7"):
        read_recipe(written(path, learning_rate=7), seed=0)
