"""What the card of a run says, and that it is about the weights beside it."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path

import pytest
from tests.support.runs import ORIGIN, save_untrained

from handsight.training.card import card_text, write_card
from handsight.training.run_folder import CARD, CARD_MARK, RUN_RECORD, WEIGHTS
from handsight.training.run_record import read_values

GOLDEN = """\
- reads: colour and height (`rgbd`)
- input, around the grasp: 100 px of the picture as 16 x 16 px
- convolutions: widths 8, 8, kernels 3, 3, stride 2
- dense layers: 16
- weights: `model.safetensors`, SHA-256 `{sha256}`
- written: `{created}` by handsight `{handsight}`

## Data

- `lab/grasps@v1`: 80 attempts, overhead picture
  - snapshot `ABCDEFGH`
  - content digest `{digest}`

## Recipe

3 passes over the data; the network is that after pass 2.

- epochs: `8`
"""
FIGURES = """\
## On held-out attempts

- attempts: 20
- balanced accuracy at S > 0.5: 0.750
- AUC: 0.875
- cross-entropy: 0.5000

## Limits

- A score is the predicted chance
"""


def test_a_card_says_what_the_record_does(tmp_path: Path) -> None:
    save_untrained(tmp_path / "run")
    card, record = (tmp_path / "run" / CARD).read_text(), read_values(tmp_path / "run" / RUN_RECORD)
    sha256 = hashlib.sha256((tmp_path / "run" / WEIGHTS).read_bytes()).hexdigest()
    said = GOLDEN.format(sha256=sha256, digest="d" * 64, **{name: record[name] for name in ("created", "handsight")})
    assert said in card
    assert FIGURES.strip() in card
    assert card.startswith(CARD_MARK)
    assert card == card_text(record)


def test_scores_of_balanced_classes_are_called_no_chance(tmp_path: Path) -> None:
    save_untrained(tmp_path / "run", balance=True)
    card = (tmp_path / "run" / CARD).read_text()
    assert "A score is no chance" in card
    assert "is the predicted chance that" not in card


def test_a_run_without_figures_has_none_in_its_card(tmp_path: Path) -> None:
    save_untrained(tmp_path / "run")
    record = read_values(tmp_path / "run" / RUN_RECORD)
    assert "so it has no figures" in card_text({**record, "kept_epoch": None})
    record["history"][1]["held_out"].update(accuracy=None, auc=None)
    assert "- AUC: too few attempts to say" in card_text(record)


@pytest.mark.parametrize("name", ["a`b|c\n# Heading\n", "x\n\n- item", "<b>"])
def test_names_of_datasets_stay_within_their_line(tmp_path: Path, name: str) -> None:
    save_untrained(tmp_path / "run", origins=(replace(ORIGIN, dataset=name),))
    lines = (tmp_path / "run" / CARD).read_text().splitlines()
    headings = [line for line in lines if line.startswith("#")]
    assert headings == [
        "# A Grasp Quality Network", "## Data", "## Recipe", "## On held-out attempts", "## Limits", "## Use"
    ]  # fmt: skip
    (line,) = [line for line in lines if line.endswith(": 80 attempts, overhead picture")]
    assert line.count("`") == 2


def test_a_readme_of_somebody_else_stays(tmp_path: Path) -> None:
    save_untrained(tmp_path / "run")
    record = read_values(tmp_path / "run" / RUN_RECORD)
    (tmp_path / "run" / CARD).write_text("# My notes")
    write_card(tmp_path / "run", record)
    assert (tmp_path / "run" / CARD).read_text() == "# My notes"
