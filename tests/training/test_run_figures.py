from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from tests.support.runs import ORIGIN, save_untrained

from handsight.training.run_figures import figures_of, version_of
from handsight.training.run_folder import RUN_RECORD
from handsight.training.run_record import read_values


def test_figures_are_those_of_the_pass_that_was_kept(tmp_path: Path) -> None:
    save_untrained(tmp_path)
    figures = figures_of(read_values(tmp_path / RUN_RECORD))
    assert (figures.kept, figures.passes, figures.held_out) == (2, 3, 20)
    assert (figures.loss, figures.accuracy, figures.auc) == (0.5, 0.75, 0.875)


def test_an_attempt_counts_once_however_many_of_its_pictures_were_used(tmp_path: Path) -> None:
    near = replace(ORIGIN, view="pregrasp", attempts=60)
    other = replace(ORIGIN, dataset="s3://lab/more", ref="main", snapshot="XYZ", attempts=7)
    save_untrained(tmp_path, origins=(ORIGIN, near, other))
    figures = figures_of(read_values(tmp_path / RUN_RECORD))
    assert figures.attempts == 87
    assert figures.data == ("lab/grasps@v1", "s3://lab/more@main")


def test_an_old_record_says_less(tmp_path: Path) -> None:
    save_untrained(tmp_path)
    record = read_values(tmp_path / RUN_RECORD)
    old = {name: record[name] for name in ("settings", "grid", "history")}
    figures = figures_of({**old, "run_version": 1, "origin": record["origins"][0]})
    assert (figures.kept, figures.auc, figures.created, figures.weights_sha256) == (None, None, None, None)
    assert figures.data == ("lab/grasps@v1",)


def test_a_sign_in_a_folder_s_name_is_no_ref() -> None:
    assert version_of({"dataset": "anna@lab/grasps", "ref": "main"}) == "anna@lab/grasps@main"
