from __future__ import annotations

import numpy as np
import pytest
from tests.support.scripted_station import ScriptedStation

from handsight.collection.depth_noise import DepthNoise
from handsight.datasets.records import RgbdFrame
from handsight.evaluation.flaws import Flaw, NoisyDepth, PushedObject, ShiftedCamera, StereoDepth, TurnedCamera
from handsight.evaluation.turned_camera import turned_frame

STATION = ScriptedStation()
FRAME = STATION.look()


def holed() -> RgbdFrame:
    frame = ScriptedStation().look()
    frame.depth[10:20, 30:40] = 0
    return frame


def test_where_nothing_is_wrong_all_is_told_as_it_is() -> None:
    flaw = Flaw()
    assert flaw.believed(STATION.spec) is STATION.spec
    assert flaw.seen(FRAME, STATION.spec, 0) is FRAME
    assert flaw.push_m is None


def test_a_shifted_camera_is_shifted_in_belief_alone() -> None:
    flaw = ShiftedCamera(x_m=0.003, y_m=-0.004)
    believed = flaw.believed(STATION.spec)
    before, after = STATION.spec.camera, believed.camera
    assert after.x_tool_camera_m - before.x_tool_camera_m == pytest.approx(0.003)
    assert after.y_tool_camera_m - before.y_tool_camera_m == pytest.approx(-0.004)
    assert (after.z_tool_camera_m, after.intrinsics) == (before.z_tool_camera_m, before.intrinsics)
    assert flaw.seen(FRAME, STATION.spec, 0) is FRAME


@pytest.mark.parametrize("kind", [ShiftedCamera, PushedObject])
def test_directions_are_of_all_sides_and_of_one_length(kind: type[ShiftedCamera | PushedObject]) -> None:
    rng = np.random.default_rng(1)
    drawn = np.array([(flaw.x_m, flaw.y_m) for flaw in (kind.draw(0.02, rng) for _ in range(200))])
    np.testing.assert_allclose(np.linalg.norm(drawn, axis=1), 0.02)
    np.testing.assert_allclose(drawn.mean(axis=0), 0, atol=0.004)
    assert {(x > 0, y > 0) for x, y in drawn} == {(True, True), (True, False), (False, True), (False, False)}


def test_a_turned_camera_changes_what_is_seen_and_not_what_is_believed() -> None:
    flaw = TurnedCamera.draw(0.1, np.random.default_rng(0))
    assert flaw.believed(STATION.spec) is STATION.spec
    seen = flaw.seen(FRAME, STATION.spec, 0)
    expected = turned_frame(FRAME, STATION.spec.camera.intrinsics, flaw.turned_from_camera)
    np.testing.assert_array_equal(seen.depth, expected.depth)
    assert (seen.depth != FRAME.depth).any()


def test_noise_is_of_its_size_and_new_with_every_look() -> None:
    flaw = NoisyDepth(deviation_m=0.004, rng=np.random.default_rng(0))
    first, second = (flaw.seen(FRAME, STATION.spec, look).depth for look in (0, 1))
    assert np.std(first.astype(float)) * STATION.spec.depth_scale_m == pytest.approx(0.004, rel=0.05)
    assert np.mean(first) * STATION.spec.depth_scale_m == pytest.approx(0.4, abs=0.001)
    assert (first != second).any()


def test_a_stereo_camera_errs_as_its_model_says() -> None:
    """0.1 pixels at 0.4 m are z^2 / (f b) * 0.1 with the focal length of 64 columns over 75 degrees."""
    flaw = StereoDepth(noise=DepthNoise(subpixel_px=0.1, seed=1))
    first, second, again = (flaw.seen(FRAME, STATION.spec, look).depth for look in (0, 1, 0))
    focal_px = 32 / np.tan(np.radians(37.5))
    assert np.std(first * STATION.spec.depth_scale_m) == pytest.approx(0.4**2 / (focal_px * 0.05) * 0.1, rel=0.15)
    assert (first != second).any()
    np.testing.assert_array_equal(first, again)
    exact_m = FRAME.depth.astype(np.float64) * STATION.spec.depth_scale_m
    expected = flaw.noise.measured(exact_m, 0) / STATION.spec.depth_scale_m
    np.testing.assert_allclose(first, expected, atol=0.5)


def test_an_object_hides_a_part_of_the_table_from_the_second_imager() -> None:
    frame = ScriptedStation().look()
    frame.depth[10:30, 20:40] = 200
    seen = StereoDepth(noise=DepthNoise(subpixel_px=1e-9, seed=1)).seen(frame, STATION.spec, 0)
    assert frame.depth.all()
    assert not seen.depth[20, 17:20].any(), "the shadow, left of what is near"
    assert seen.depth[20, 41:60].all()


@pytest.mark.parametrize(
    "flaw",
    [
        NoisyDepth(deviation_m=0.004, rng=np.random.default_rng(0)),
        StereoDepth(noise=DepthNoise(subpixel_px=0.1, seed=1)),
    ],
)
def test_what_is_invalid_stays_so_and_makes_nothing_else_invalid(flaw: Flaw) -> None:
    hole = holed()
    seen = flaw.seen(hole, STATION.spec, 0).depth
    assert seen.dtype == hole.depth.dtype
    np.testing.assert_array_equal(seen > 0, hole.depth > 0)
    blind = ScriptedStation(depth_m=0.0).look()
    assert not flaw.seen(blind, STATION.spec, 0).depth.any()


def test_depth_stays_within_its_type() -> None:
    near, far = ScriptedStation(depth_m=0.001).look(), ScriptedStation(depth_m=65.5).look()
    flaw = NoisyDepth(deviation_m=0.1, rng=np.random.default_rng(0))
    assert flaw.seen(near, STATION.spec, 0).depth.min() == 1
    assert flaw.seen(far, STATION.spec, 0).depth.max() == 65535
    assert flaw.seen(far, STATION.spec, 0).depth.min() > 60000


def test_what_is_pushed_is_pushed_as_drawn() -> None:
    flaw = PushedObject(x_m=0.01, y_m=-0.02)
    assert flaw.push_m == (0.01, -0.02)
    assert flaw.seen(FRAME, STATION.spec, 0) is FRAME
    assert flaw.believed(STATION.spec) is STATION.spec
