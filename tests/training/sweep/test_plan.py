from __future__ import annotations

import json
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import pytest
from tests.support.swept import make_swept, swept_plan

from handsight.training.errors import SweepFolderError, SweepPlanError
from handsight.training.sweep.plan import PLAN, PLAN_VERSION, SweepPlan, extended, read_plan, write_plan


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> SweepPlan:
    return swept_plan(make_swept(tmp_path_factory.mktemp("plan") / "grasps"), varied={"mixup": ("0", "0.2")})


def test_a_plan_is_read_as_it_was_written(plan: SweepPlan, tmp_path: Path) -> None:
    write_plan(tmp_path, plan)
    assert read_plan(tmp_path) == plan


def test_cells_are_every_combination_trial_by_trial_and_the_largest_first(plan: SweepPlan) -> None:
    cells = list(replace(plan, sizes=(12, None, 20)).cells())
    assert len(cells) == len({cell.name for cell in cells}) == 3 * 3 * 2 * 2
    assert [cell.trial for cell in cells] == sorted(cell.trial for cell in cells)
    assert [cell.size for cell in cells[:12]] == [None] * 4 + [20] * 4 + [12] * 4
    assert {cell.varied for cell in cells} == {(("mixup", "0"),), (("mixup", "0.2"),)}


def test_all_cells_of_a_trial_start_from_the_same_seed_and_trials_do_not(plan: SweepPlan) -> None:
    assert len({plan.training_seed(trial) for trial in range(100)}) == 100
    assert plan.training_seed(4) != replace(plan, seed=1).training_seed(4)


def test_more_can_be_asked_for_and_nothing_else(plan: SweepPlan) -> None:
    more = replace(
        plan,
        trials=4,
        sizes=(30, 12, 20),
        channels=("depth", "rgb", "rgbd"),
        varied={"mixup": ("0.2", "0", "1")},
        divisions=((*plan.divisions[0], "d"),),
    )
    assert extended(plan, more) == more
    other = replace(plan, seed=3, held_out=0.5, trials=2, sizes=(12,), handsight="9.9")
    with pytest.raises(SweepPlanError) as refused:
        extended(plan, other)
    for part in ("seed 0, now 3", "held_out 0.34, now 0.5", "trials 3, now 2", "sizes [12, 20], now [12]", "handsight"):
        assert part in str(refused.value)
    assert extended(plan, replace(plan, handsight="9.9"), allowed=["handsight"]).handsight == "9.9"


def test_trials_that_are_divided_otherwise_are_another_plan(plan: SweepPlan) -> None:
    with pytest.raises(SweepPlanError, match="divisions"):
        extended(plan, replace(plan, divisions=(("x", *plan.divisions[0][1:]),)))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "is damaged"),
        ("[]", "is damaged"),
        ('{"plan_version": 1}', "is damaged"),
        (json.dumps({"plan_version": PLAN_VERSION + 1}), "newer handsight"),
    ],
)
def test_a_damaged_plan_is_refused(tmp_path: Path, content: str, message: str) -> None:
    (tmp_path / PLAN).write_text(content)
    with pytest.raises(SweepFolderError, match=message):
        read_plan(tmp_path)


def test_every_value_of_a_plan_may_be_damaged(plan: SweepPlan, tmp_path: Path) -> None:
    """It is refused or read, and never ends in another error."""
    whole = plan.to_json()
    for name in whole:
        for odd in (None, -1, "x", [], {}, [None], {"a": 1}):
            (tmp_path / PLAN).write_text(json.dumps({**whole, name: odd}))
            with suppress(SweepFolderError):
                read_plan(tmp_path)


def test_a_folder_without_a_plan_says_how_to_begin(tmp_path: Path) -> None:
    with pytest.raises(SweepFolderError, match=r"holds no sweep .* see 'handsight ablate --help'"):
        read_plan(tmp_path)


def test_sizes_are_the_usual_ones_as_far_as_there_are_attempts(tmp_path: Path) -> None:
    assert swept_plan(make_swept(tmp_path / "few"), sizes=()).sizes == (None,)
    many = swept_plan(make_swept(tmp_path / "many", attempts=800), sizes=())
    assert many.sizes == (250, 500)


@pytest.mark.parametrize("changes", [{"trials": 0}, {"held_out": 0.0}, {"held_out": 1.0}, {"seed": -1}])
def test_a_plan_out_of_range_is_refused(plan: SweepPlan, changes: dict[str, float]) -> None:
    with pytest.raises(SweepPlanError, match="expected"):
        replace(plan, **changes)  # type: ignore[arg-type]


def test_datasets_are_called_by_the_last_part_of_their_address_unless_two_end_alike(plan: SweepPlan) -> None:
    one = plan.datasets[0]

    def names(*addresses: str) -> tuple[str, ...]:
        datasets = tuple(replace(one, address=address) for address in addresses)
        return replace(plan, datasets=datasets, divisions=plan.divisions * len(datasets)).dataset_names

    assert names("/data/clean@v1", "s3://lab/noisy@v1") == ("clean@v1", "noisy@v1")
    assert names("a/grasps@v1", "b/grasps@v1") == ("a/grasps@v1", "b/grasps@v1")
