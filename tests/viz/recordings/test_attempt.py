"""A recorded attempt, read back: every number in it is one that was recorded."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.support.rrd import decode, read_recording, verify

from handsight.collection.attempt import attempt_seed, run_attempt
from handsight.collection.policy import UniformPolicy
from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.station import SimStation
from handsight.datasets.records import PHASES, GraspAttempt, StationSpec
from handsight.datasets.views import station_view
from handsight.servoing.planar import PlanarPose, PlanarStep
from handsight.viz import palette
from handsight.viz.errors import RecordingError
from handsight.viz.pixels import PictureFrame
from handsight.viz.recordings.attempt import (
    TIMELINE,
    AttemptExample,
    label_colour,
    pregrasp_pose,
    step_from,
    write_attempt,
)
from handsight.viz.recordings.layouts import CAMERA


@pytest.fixture(scope="module")
def recorded() -> tuple[GraspAttempt, StationSpec]:
    station = SimStation(SimConfig(objects="blocks-train"))
    try:
        return run_attempt(station, UniformPolicy(), 3, attempt_seed(5, 3)), station.spec
    finally:
        station.close()


@pytest.fixture(scope="module")
def example(recorded: tuple[GraspAttempt, StationSpec]) -> AttemptExample:
    attempt, station = recorded
    return AttemptExample(
        name="attempt-01M82D0ES98VNXTNKDRF7H092G-000003",
        title="block · held · 3",
        attempt=attempt,
        station=station,
        success=True,
        notes=(("curation", "nothing decided"),),
        commands=("handsight dataset exclude grasps 3 -m why",),
    )


def test_what_is_read_back_is_what_was_recorded(example: AttemptExample, tmp_path: Path) -> None:
    path = tmp_path / "attempt.rrd"
    write_attempt(path, example)
    assert verify(path).returncode == 0
    content = read_recording(path, timeline=TIMELINE)
    attempt, _station = example.attempt, example.station
    assert attempt.overhead is not None
    ((_, (depth,)),) = content[f"{CAMERA}/depth"]["EncodedDepthImage:blob"]
    np.testing.assert_array_equal(decode(depth), attempt.overhead.depth)
    ((_, (rgb,)),) = content[f"{CAMERA}/rgb"]["EncodedImage:blob"]
    assert np.abs(decode(rgb).astype(int) - attempt.overhead.rgb).mean() < 4
    ends_s = np.cumsum(attempt.phase_s.astype(float))
    openings = [value[0] for _, value in content["/plots/opening/jaws_mm"]["Scalars:scalars"]]
    gripper = attempt.gripper
    np.testing.assert_allclose(
        openings, [1e3 * width_m for width_m in (gripper.before_m, gripper.closed_m, gripper.lifted_m, gripper.final_m)]
    )
    times = [time for time, _ in content["/plots/opening/jaws_mm"]["Scalars:scalars"]]
    seconds = [time.total_seconds() for time in times]  # type: ignore[union-attr]
    expected = [ends_s[PHASES.index(phase)] for phase in ("reach", "close", "lift", "shake")]
    np.testing.assert_allclose(seconds, expected, atol=1e-6)
    (_, force) = content["/plots/force/contact_n"]["Scalars:scalars"][-1]
    assert force == [pytest.approx(attempt.contact_force_n)]
    ((_, (centre,)),) = content["/world/grasp"]["Transform3D:translation"]
    np.testing.assert_allclose(centre, attempt.pose_base_tool_grasp[:3, 3], atol=1e-6)
    ((_, (text,)),) = content["/text/attempt"]["TextDocument:text"]
    assert "**held**" in text or "**empty**" in text
    assert example.commands[0] in text


def test_the_jaws_lie_where_the_grasp_was_attempted(example: AttemptExample, tmp_path: Path) -> None:
    write_attempt(tmp_path / "attempt.rrd", example)
    content = read_recording(tmp_path / "attempt.rrd", timeline=TIMELINE)
    attempt, frame = example.attempt, example.attempt.overhead
    assert frame is not None
    goal = pregrasp_pose(attempt.pregrasp_x_m, attempt.pregrasp_y_m, attempt.pregrasp_angle_rad)
    assert goal is not None
    step = step_from(frame, goal)
    dx_m, dy_m, dangle_rad = step
    reached = PlanarPose.from_pose_base_tool(frame.pose_base_tool).after(
        PlanarStep(dx_m=dx_m, dy_m=dy_m, dangle_rad=dangle_rad)
    )
    assert (reached.x_m, reached.y_m) == pytest.approx((attempt.pregrasp_x_m, attempt.pregrasp_y_m))
    view = station_view(frame, example.station)
    jaws = PictureFrame(camera=view.camera, plane_m=view.plane_m).jaws(step, example.station.gripper_stroke_m)
    ((_, strips),) = content[f"{CAMERA}/jaws/line"]["LineStrips2D:strips"]
    np.testing.assert_allclose(strips, jaws, atol=1e-3)


def test_an_attempt_without_a_picture_is_refused_and_leaves_nothing(example: AttemptExample, tmp_path: Path) -> None:
    blind = replace(example, attempt=replace(example.attempt, overhead=None, failure="look: no camera"))
    with pytest.raises(RecordingError, match="look: no camera"):
        write_attempt(tmp_path / "attempt.rrd", blind)
    assert list(tmp_path.iterdir()) == []


def test_an_attempt_that_chose_no_pose_has_no_jaws(example: AttemptExample, tmp_path: Path) -> None:
    lost = replace(
        example,
        success=None,
        attempt=replace(example.attempt, pregrasp_x_m=float("nan"), pose_base_tool_grasp=np.full((4, 4), np.nan)),
    )
    write_attempt(tmp_path / "attempt.rrd", lost)
    content = read_recording(tmp_path / "attempt.rrd", timeline=TIMELINE)
    assert not {f"{CAMERA}/jaws/line", "/world/grasp", "/input/rgb"} & content.keys()


def test_labels_have_colours_of_their_own() -> None:
    assert [label_colour(label) for label in (True, False, None)] == [palette.HELD, palette.EMPTY, palette.STEEL]
