"""The part of the workspace that is reached: asked cell by cell, drawn from alone, refused for another workspace."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import NDArray

from handsight.collection.errors import PoseRefusedError, RigSettingsError
from handsight.collection.ur10.arm import Arm
from handsight.collection.ur10.calibration import Calibration, ReachCalibration, load_calibration, save_calibration
from handsight.collection.ur10.reach import calibrate_reach, cells, check_reach, reached_workspace
from handsight.collection.ur10.rig import WorkspaceConfig

AREA = WorkspaceConfig(x_min_m=0.5, x_max_m=0.61, y_min_m=-0.1, y_max_m=0.1)


@dataclass
class FencedArm:
    """Allows what lies on one side of a safety plane; the tip of a corner is beyond its joints."""

    rig: Any

    def allowed_by_controller(self, pose_base_tool: NDArray[np.float64]) -> bool:
        x_m, y_m, _ = pose_base_tool[:3, 3]
        if x_m < 0.52 and y_m < -0.08:
            raise PoseRefusedError("joint 3")
        return bool(x_m + y_m < 0.62)


@dataclass
class Rig:
    workspace: WorkspaceConfig


def measured(area: WorkspaceConfig = AREA) -> ReachCalibration:
    asked: list[int] = []
    found = calibrate_reach(cast(Arm, FencedArm(Rig(area))), on_cell=lambda: asked.append(1))
    assert len(asked) == cells(area) == 60
    return found


def test_every_cell_is_asked_for() -> None:
    found = measured()
    assert (len(found.rows), len(found.rows[0])) == (6, 10)
    for row, line in enumerate(found.rows):
        for column, cell in enumerate(line):
            x_m, y_m = min(0.51 + 0.02 * row, 0.61), -0.09 + 0.02 * column
            beyond = x_m < 0.52 and y_m < -0.08
            assert cell == ("#" if not beyond and x_m + y_m < 0.62 else "."), (x_m, y_m)
    assert found.share == pytest.approx(44 / 60)


def test_points_are_drawn_uniformly_from_what_is_reached() -> None:
    found = measured()
    workspace = reached_workspace(AREA, found)
    rng = np.random.default_rng(0)
    points = np.array([workspace.sample(rng) for _ in range(6000)])
    row = ((points[:, 0] - 0.5) / 0.02).astype(int)
    column = ((points[:, 1] + 0.1) / 0.02).astype(int)
    counts = np.zeros((6, 10), int)
    np.add.at(counts, (row, column), 1)
    reached = np.array([[cell == "#" for cell in line] for line in found.rows])
    assert not counts[~reached].any()
    whole = reached[:5]  # The last row of cells reaches beyond the workspace.
    expected = len(points) / (whole.sum() + 0.5 * reached[5].sum())
    assert counts[:5][whole] == pytest.approx(expected, rel=0.4)


def test_a_rig_of_which_nothing_was_asked_draws_from_all_of_it() -> None:
    assert reached_workspace(AREA, None) == AREA.area


def test_a_map_of_another_workspace_is_refused() -> None:
    found = measured()
    check_reach(found, AREA)
    check_reach(found, replace(AREA, y_max_m=0.05))
    with pytest.raises(RigSettingsError, match="'rig calibrate reach'"):
        check_reach(found, replace(AREA, x_max_m=0.7))
    with pytest.raises(RigSettingsError, match="'rig calibrate reach'"):
        check_reach(found, replace(AREA, y_min_m=-0.2))


def test_a_workspace_behind_the_fence_is_refused() -> None:
    with pytest.raises(RigSettingsError, match="0% of the workspace is reached, expected at least 20%"):
        calibrate_reach(cast(Arm, FencedArm(Rig(replace(AREA, x_min_m=0.7, x_max_m=0.8)))))
    beyond = replace(measured(), rows=(("." * 10,) * 6))
    with pytest.raises(RigSettingsError, match="0% is reached"):
        check_reach(beyond, AREA)


def test_a_map_survives_its_file_and_a_damaged_one_is_told(tmp_path: Path) -> None:
    path = tmp_path / "calibration.json"
    calibration = Calibration(reach=measured())
    save_calibration(path, calibration)
    assert load_calibration(path) == calibration
    path.write_text(path.read_text(encoding="utf-8").replace("##", "#?"), encoding="utf-8")
    with pytest.raises(RigSettingsError, match="damaged"):
        load_calibration(path)
