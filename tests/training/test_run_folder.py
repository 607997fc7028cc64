"""Where a run can be written, asked before hours are spent on training."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.support.small_disk import files_of_at_most

from handsight.training.errors import CheckpointError
from handsight.training.run_folder import CARD, CARD_MARK, EVENTS, NEXT_WEIGHTS, RUN_RECORD, WEIGHTS, check_run_folder


def test_a_new_or_empty_folder_will_do(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    for name in ("empty", "new", "new/below"):
        check_run_folder(tmp_path / name)
    assert [path.name for path in tmp_path.iterdir()] == ["empty"]


@pytest.mark.parametrize("held", [(RUN_RECORD, WEIGHTS), (WEIGHTS,), (RUN_RECORD, NEXT_WEIGHTS), (RUN_RECORD,)])
def test_a_run_is_replaced_only_on_request(tmp_path: Path, held: tuple[str, ...]) -> None:
    for name in held:
        (tmp_path / name).write_text("")
    with pytest.raises(CheckpointError, match="replace it with --overwrite"):
        check_run_folder(tmp_path)
    check_run_folder(tmp_path, overwrite=True)


def test_what_a_killed_process_left_is_no_run(tmp_path: Path) -> None:
    (tmp_path / NEXT_WEIGHTS).write_text("")
    (tmp_path / ".run.unfinished-12345678.json").write_text("")
    (tmp_path / ".model.next.unfinished-12345678.safetensors").write_text("")
    (tmp_path / ".README.unfinished-12345678.md").write_text("")
    (tmp_path / EVENTS).mkdir()
    check_run_folder(tmp_path)


def test_a_readme_is_replaced_only_where_it_is_a_card_of_a_run(tmp_path: Path) -> None:
    (tmp_path / RUN_RECORD).write_text("")
    (tmp_path / CARD).write_text(f"{CARD_MARK}\n# A network")
    check_run_folder(tmp_path, overwrite=True)
    (tmp_path / CARD).write_text("# My notes")
    with pytest.raises(CheckpointError, match=r"other files \(README.md\)"):
        check_run_folder(tmp_path, overwrite=True)
    (tmp_path / CARD).unlink()
    (tmp_path / CARD).symlink_to(tmp_path / RUN_RECORD)
    with pytest.raises(CheckpointError, match=r"other files \(README.md\)"):
        check_run_folder(tmp_path, overwrite=True)


@pytest.mark.parametrize("overwrite", [False, True])
def test_other_things_are_never_replaced(tmp_path: Path, overwrite: bool) -> None:
    (tmp_path / RUN_RECORD).write_text("")
    for name in ("a.tex", "b.tex", "c.tex", "d.tex"):
        (tmp_path / name).write_text("years of work")
    with pytest.raises(CheckpointError, match=r"other files \(a.tex, b.tex, c.tex and 1 more\)"):
        check_run_folder(tmp_path, overwrite=overwrite)
    with pytest.raises(CheckpointError, match=r"a\.tex is a file"):
        check_run_folder(tmp_path / "a.tex", overwrite=overwrite)
    with pytest.raises(CheckpointError, match=r"a\.tex is a file, expected a folder"):
        check_run_folder(tmp_path / "a.tex" / "run", overwrite=overwrite)


def test_a_link_to_nowhere_says_so(tmp_path: Path) -> None:
    (tmp_path / "run").symlink_to(tmp_path / "gone")
    for name in ("run", "run/below"):
        with pytest.raises(CheckpointError, match=r"run is a link to .*gone, which is not there"):
            check_run_folder(tmp_path / name)


def test_a_folder_that_cannot_be_written_to_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CheckpointError, match=r"/proc takes no new files"):
        check_run_folder(Path("/proc/new/run"))
    with files_of_at_most(0), pytest.raises(CheckpointError, match=f"{tmp_path} takes no new files: File too large"):
        check_run_folder(tmp_path / "new" / "run")
