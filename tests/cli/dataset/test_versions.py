"""The commands of curation, versions and checks: what they print for programs, what they change, how they exit."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.support.small_station import small_header
from typer.testing import CliRunner

from handsight.cli.dataset.app import dataset_app
from handsight.cli.errors import CommandError
from handsight.datasets import (
    PHASES,
    AttemptNotFoundError,
    CorruptDataError,
    CurationError,
    GraspAttempt,
    GraspDataset,
    GraspRepository,
    GripperReadings,
    Outcome,
    RefNotFoundError,
    RgbdFrame,
    SessionWriter,
    WhereError,
)

HEADER = small_header(source="ur10", seed=None)


def attempt(number: int) -> GraspAttempt:
    """Held and empty by turns, sound in every other respect."""
    rng = np.random.default_rng(number)
    pose = np.diag([1.0, -1.0, -1.0, 1.0])
    pose[2, 3] = 0.5
    pictures = [
        RgbdFrame(
            rgb=rng.integers(0, 256, (48, 64, 3), dtype=np.uint8),
            depth=rng.integers(560, 601, (48, 64)).astype(np.uint16),
            pose_base_tool=pose,
        )
        for _ in range(2)
    ]
    width_m = 0.0 if number % 2 else 0.03
    return GraspAttempt(
        number=number,
        outcome=Outcome.EMPTY if number % 2 else Outcome.HELD,
        failure="",
        overhead=pictures[0],
        pregrasp=pictures[1],
        pregrasp_x_m=0.01 * number,
        pregrasp_y_m=0.0,
        pregrasp_angle_rad=0.1 * number,
        pose_base_tool_grasp=pose,
        contact_force_n=float(number),
        gripper=GripperReadings(before_m=0.085, closed_m=width_m, lifted_m=width_m, final_m=width_m),
        scene=None,
        truth_held=None,
        phase_s=np.ones(len(PHASES), np.float32),
        started_ns=(1_700_000_000 + 60 * number) * 10**9,
        elapsed_ns=10 * 10**9,
    )


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Six attempts, 0, 2 and 4 of them held."""
    writer = SessionWriter.begin(GraspRepository.create(tmp_path / "grasps"), HEADER)
    for number in range(6):
        writer.append(attempt(number))
    writer.seal()
    return tmp_path / "grasps"


def invoke(*words: object, code: int = 0) -> str:
    answer = CliRunner().invoke(dataset_app, [str(word) for word in words], catch_exceptions=False)
    assert answer.exit_code == code, answer.output
    return answer.stdout


def json_of(*words: object, code: int = 0) -> Any:
    return json.loads(invoke(*words, "--json", code=code))


def ids(path: Path, *numbers: int) -> list[str]:
    return GraspDataset.open(str(path)).attempts.index[list(numbers)].tolist()


def test_exclude_restore_and_undo(path: Path) -> None:
    before = GraspDataset.open(str(path)).snapshot_id
    planned = json_of("exclude", path, "--where", "success", "-m", "x", "--dry-run")
    assert planned == {"attempts": ids(path, 0, 2, 4), "decision": None}
    assert GraspDataset.open(str(path)).snapshot_id == before
    done = json_of("exclude", path, *ids(path, 0, 1), "-m", "cable in view", "--author", "anna")
    assert done == {"attempts": ids(path, 0, 1), "decision": 0}
    assert json_of("restore", path, "--where", "excluded and success", "-m", "fine")["attempts"] == ids(path, 0)
    assert GraspDataset.open(str(path)).info().excluded == 1
    assert "is reverted" in invoke("undo", path)
    listed = json_of("decisions", path)
    assert [(one["action"], one["counts"]) for one in listed] == [("exclude", True), ("restore", False), ("undo", True)]
    assert (listed[0]["author"], listed[0]["reason"]) == ("anna", "cable in view")
    assert "nothing to do" in invoke("exclude", path, "--where", "excluded", "-m", "x")
    assert f"undo {path} 3" in invoke("exclude", path, "--where", "number == 5", "-m", "x")


def test_relabel_there_and_back(path: Path) -> None:
    held = json_of("relabel", path, "--where", "number <= 1", "--to", "failure", "-m", "x")
    assert held["attempts"] == ids(path, 0)
    assert GraspDataset.open(str(path)).info().successes == 2
    back = json_of("relabel", path, *ids(path, 0, 1), "--to", "recorded", "-m", "x")
    assert back["attempts"] == ids(path, 0)
    assert GraspDataset.open(str(path)).info().successes == 3
    invoke("relabel", path, "--where", "success", "--to", "maybe", "-m", "x", code=2)


def test_bad_input_changes_nothing(path: Path) -> None:
    tip = GraspDataset.open(str(path)).snapshot_id
    for words, error in (
        (("exclude", path, "nowhere-000000", "-m", "x"), AttemptNotFoundError),
        (("exclude", path, "--where", "sucess", "-m", "x"), WhereError),
        (("exclude", path, "-m", "x"), WhereError),
        (("exclude", path, "--where", "success", "-m", ""), CurationError),
        (("exclude", f"{path}@v1", "--where", "success", "-m", "x"), RefNotFoundError),
        (("diff", path, "v9"), RefNotFoundError),
        (("revert", path, "v9"), RefNotFoundError),
    ):
        with pytest.raises(error):
            invoke(*words)
    invoke("exclude", path, "--where", "success", code=2)
    for age in ("yesterday", "99999999999999w", "999999999d", "9" * 4400 + "d", "0001-01-01", "9999-12-31", "7y", ""):
        for verb in ("gc", "expire"):
            with pytest.raises(CommandError, match="expected such as 2h, 7d or 2026-01-31"):
                invoke(verb, path, "--older-than", age)
    for verb in ("doctor", "folds"):
        invoke(verb, path, "--seed", "-1", code=2)
    invoke("filter", path, "name", code=2)
    assert GraspDataset.open(str(path)).snapshot_id == tip


def test_filters_are_saved_used_and_forgotten(path: Path) -> None:
    assert "matches 3 attempts now" in invoke("filter", path, "held", "--where", "success")
    assert json_of("filter", path) == [{"filter": "held", "where": "success", "attempts": 3}]
    assert json_of("exclude", path, "--filter", "held", "-m", "x")["attempts"] == ids(path, 0, 2, 4)
    assert "held" in invoke("filter", path)
    invoke("filter", path, "held", "--delete")
    assert json_of("filter", path) == []


def test_folds_are_made_listed_and_checked(path: Path) -> None:
    writer = SessionWriter.begin(GraspRepository.open(path), HEADER)
    for number in range(6):
        writer.append(attempt(number))
    writer.seal()
    made = json_of("folds", path, "cv", "--by", "session", "--count", "2")
    assert [(row["fold"], row["attempts"], row["successes"]) for row in made] == [(0, 6, 3), (1, 6, 3)]
    assert json_of("folds", path) == json_of("folds", path, "cv") == made
    assert "50.0%" in invoke("folds", path)


def test_versions_branch_diff_and_revert(path: Path) -> None:
    GraspRepository.open(path).release("v1")
    invoke("branch", path, "dev")
    invoke("exclude", f"{path}@dev", "--where", "number == 2", "-m", "x")
    diff = json_of("diff", f"{path}@v1", "dev")
    assert diff["excluded"] == ids(path, 2)
    assert (diff["added"], diff["restored"], diff["relabelled"]) == ([], [], [])
    assert diff == json_of("diff", f"{path}@v1", f"{path}@dev")
    assert (diff["balance_before"]["successes"], diff["balance_after"]["successes"]) == (3, 2)
    assert "3 of 6 (50.0%) -> 2 of 5 (40.0%)" in invoke("diff", f"{path}@v1", "dev")
    planned = json_of("revert", f"{path}@dev", "v1", "--dry-run")
    assert (planned["snapshot"], planned["diff"]["restored"]) == (None, ids(path, 2))
    done = json_of("revert", f"{path}@dev", "v1")
    assert done["snapshot"] == GraspRepository.open(path).resolve("dev")
    assert "the same attempts" in invoke("diff", f"{path}@v1", "dev")
    assert "has that content already" in invoke("revert", f"{path}@dev", "v1")
    assert {row["branch"] for row in json_of("branch", path)} == {"dev", "main"}
    invoke("branch", path, "dev", "--delete", "--force")
    assert {row["branch"] for row in json_of("branch", path)} == {"main"}


def test_doctor_verify_and_repair(path: Path) -> None:
    assert json_of("doctor", path, "--deep") == {"ok": True, "findings": []}
    assert "no errors or warnings" in invoke("doctor", path)
    report = json_of("verify", path)
    assert (report["checked"], report["corrupt"]) == (6, [])
    assert "nothing is damaged" in invoke("repair", path, "--branch", "repaired")
    largest = max((path / "chunks").iterdir(), key=lambda chunk: chunk.stat().st_size)
    largest.write_bytes(bytes(largest.stat().st_size))
    report = json_of("verify", path, "-j", 1, code=1)
    assert len(report["corrupt"]) == 1
    (finding,) = json_of("doctor", path, "--deep", code=1)["findings"]
    assert finding.keys() == {"code", "severity", "attempts", "message"}
    assert "1 of them corrupt" in invoke("verify", path, code=1)
    done = json_of("repair", path, "--branch", "repaired", "--author", "anna")
    assert done["lost"] == report["corrupt"]
    assert json_of("verify", f"{path}@repaired")["corrupt"] == []


def test_stats_count_what_training_sees(path: Path) -> None:
    invoke("exclude", path, "--where", "number == 0", "-m", "x")
    stats = json_of("stats", path)
    assert (stats["labelled"], stats["successes"], stats["excluded"], stats["unlabelled"]) == (5, 2, 1, 0)
    (session,) = stats["sessions"]
    assert (session["attempts"], session["successes"]) == (5, 2)
    assert sum(share["attempts"] for share in stats["force_n"]) == 5
    assert [share["successes"] for share in stats["width_m"]] == [0, 2]
    assert "2 of 5 labelled attempts succeed" in invoke("stats", path)


def test_gc_and_expire_plan_before_they_act(path: Path) -> None:
    assert "would have deleted 0.0 MB" in invoke("gc", path, "--dry-run")
    assert json_of("gc", path, "--older-than", "7d")["chunks"] == 0
    invoke("exclude", path, "--where", "number == 0", "-m", "x")
    planned = json_of("expire", path, "--older-than", "0s", "--dry-run")
    assert len(planned["snapshots"]) > 0
    assert len(GraspRepository.open(path).log()) > 1
    assert json_of("expire", path, "--older-than", "0s")["snapshots"] == planned["snapshots"]
    assert len(GraspRepository.open(path).log()) == 1
    assert GraspDataset.open(str(path)).info().excluded == 1
    assert "dropped 0 commits" in invoke("expire", path, "--older-than", "2020-01-31")


def test_a_lost_release_is_named_and_repaired(path: Path) -> None:
    invoke("release", path, "v1")
    shutil.rmtree(path / "refs" / "tag.v1")
    (fault,) = json_of("verify", path, code=1)["lost_refs"]
    assert fault.startswith(f"release 'v1' of {path} is gone: it was ")
    with pytest.raises(CorruptDataError, match="collecting garbage is refused: release 'v1'"):
        invoke("gc", path)
    done = json_of("repair", path, "--branch", "repaired")
    assert (done["restored"], done["lost_refs"], done["branch"]) == (["v1"], [], None)
    assert json_of("verify", f"{path}@v1")["lost_refs"] == []
