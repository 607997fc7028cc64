"""Tables cleared on the real simulator, by a rule in the part of a network."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from tests.support.scorers import FunctionScorer
from tests.support.scripted_station import ScriptedStation
from torch import Tensor

from handsight.collection.errors import SceneUnsettledError
from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.station import SimStation
from handsight.collection.station import ClearingStation
from handsight.evaluation.clearance import ClearanceSettings, ClearedTable, clear_table
from handsight.evaluation.errors import EvaluationSettingsError

SETTINGS = ClearanceSettings(methods=("cem-1",), tables=1, seed=7, failures=2)


def between_the_jaws(inputs: Tensor) -> Tensor:
    """High where something stands in the middle and nothing where the fingers come down, 9 px to either side."""
    height_m = -inputs[:, 3]
    middle = height_m[:, 30:34, 30:34].mean(dim=(1, 2))
    fingers = height_m[:, 28:36, [*range(20, 25), *range(39, 44)]].amax(dim=(1, 2))
    return (0.2 + 30 * (middle - fingers)).clamp(0, 1)


BETWEEN = FunctionScorer(between_the_jaws)


@pytest.fixture(scope="module")
def station() -> Iterator[SimStation]:
    opened = SimStation(SimConfig(objects="blocks-test", objects_per_scene=2))
    yield opened
    opened.close()


def cleared(station: SimStation, number: int, method: str = "cem-1") -> ClearedTable:
    return clear_table(station, BETWEEN, method, number, SETTINGS)


def test_tables_are_cleared_and_what_is_done_depends_on_seed_and_number_alone(station: SimStation) -> None:
    tables = [cleared(station, number) for number in range(3)]
    assert cleared(station, 1) == tables[1]
    assert sum(table.cleared for table in tables) >= 3
    for table in tables:
        assert table.cleared <= table.objects == 2
        assert table.successes <= table.attempts
        assert table.stopped or table.attempts >= table.cleared
        # A label that is success with nothing off the table would take nothing away.
        assert abs(table.successes - table.cleared) <= 1


def test_a_table_ends_after_so_many_grasps_that_bring_nothing(station: SimStation) -> None:
    nowhere = FunctionScorer(lambda inputs: inputs.new_zeros(len(inputs)) + 0.99)  # Content with wherever it starts.
    tables = [clear_table(station, nowhere, "cem-1", number, SETTINGS) for number in range(6)]
    stopped = [table for table in tables if table.stopped]
    assert stopped
    for table in stopped:
        assert "2 grasps in a row brought nothing" in table.stopped
        assert table.attempts >= 2
        assert table.cleared < table.objects


def test_what_is_left_stays_where_it_was(station: SimStation) -> None:
    rng = np.random.default_rng(3)
    scene = station.reset(rng)
    before = scene.pose_base_object
    after = station.go_on(rng, held=False)
    assert after.taken == 0
    assert after.scene is not None
    np.testing.assert_array_equal(after.scene.catalogue_index, scene.catalogue_index)
    np.testing.assert_allclose(after.scene.pose_base_object[:, :3], before[:, :3], atol=2e-3)
    assert station.width_m == pytest.approx(0.085, abs=1e-3)


class Rolling(ScriptedStation):
    """What is left never comes to rest."""

    def go_on(self, rng: np.random.Generator, *, held: bool) -> Any:
        raise SceneUnsettledError("scripted")


def test_a_scene_that_does_not_come_to_rest_ends_its_table_without_a_grasp() -> None:
    table = clear_table(Rolling(faults={"settle": 0}), None, "random", 0, SETTINGS)
    assert (table.objects, table.attempts, table.cleared) == (0, 0, 0)
    assert "settle: scripted" in table.stopped


def test_a_station_clears_its_first_table_and_one_that_cannot_go_on_is_refused() -> None:
    """A station that has made no scene yet has no arm to be asked for its opening."""
    fresh = SimStation(SimConfig(objects="blocks-test", objects_per_scene=2))
    try:
        assert isinstance(fresh, ClearingStation)
        assert cleared(fresh, 0, "random").objects == 2
    finally:
        fresh.close()
    with pytest.raises(EvaluationSettingsError, match="ScriptedStation, which makes a new scene for every grasp"):
        clear_table(ScriptedStation(), None, "random", 0, SETTINGS)


@pytest.mark.parametrize("name", ["tables", "failures", "workers"])
def test_settings_out_of_range_are_refused(name: str) -> None:
    values: dict[str, Any] = {"methods": ("random",), "tables": 1, name: 0}
    with pytest.raises(EvaluationSettingsError, match=f"{name} is 0, expected 1 or more"):
        ClearanceSettings(**values)
