"""Settings of the simulated station as sessions record them."""

from __future__ import annotations

import json

import pytest

from handsight.collection.errors import StationSettingsError
from handsight.collection.sim.config import PHYSICS_VERSION, SimConfig, recorded_physics

RECORDED = (
    '{"objects": "household-train", "objects_per_scene": 5, "drop_height_m": 0.15, "overhead_height_m": 0.5, '
    '"pregrasp_height_m": 0.4, "lift_height_m": 0.25, "table_height_m": 0.005, "contact_force_n": 10.0, '
    '"touch_speed_m_s": 0.1, "yield_force_n": 15.0, "shakes": 0, '
    '"workspace": {"x_min_m": 0.5, "x_max_m": 0.8, "y_min_m": -0.15, "y_max_m": 0.15}, "camera": {"intrinsics": '
    '{"width": 640, "height": 480, "fx": 617.1589761579678, "fy": 617.1589761579678, "cx": 319.5, "cy": 239.5}, '
    '"x_tool_camera_m": 0.0, "y_tool_camera_m": -0.055, "z_tool_camera_m": -0.1}, "depth_scale_m": 0.001, '
    '"gripper": "2f-85", "closed_width_m": 0.001, "grip_force_n": 40.0, "finger_friction": 1.8, '
    '"sticky_contacts": true, "physics_hz": 240, "solver_iterations": 50, "solver_residual": 0.0001, '
    '"grip_iterations": 100, "settle_limit_s": 5.0, "vary": ["table", "light"], "renderer": "tiny", '
    '"gripper_stroke_m": 0.085, "physics": 3}'
)
"""As a session has stored them."""


def test_recorded_settings_come_back_to_the_letter() -> None:
    config = SimConfig.from_json(json.loads(RECORDED))
    assert config == SimConfig(vary=("table", "light"))
    assert json.dumps(config.to_json()) == RECORDED


def test_a_session_from_before_a_setting_has_its_default() -> None:
    older = json.loads(RECORDED)
    for name in ("vary", "renderer", "solver_residual", "gripper", "physics"):
        del older[name]
    assert SimConfig.from_json(older) == SimConfig()


def test_settings_that_cannot_be_are_refused() -> None:
    with pytest.raises(StationSettingsError, match="shakes is -1"):
        SimConfig.from_json({**json.loads(RECORDED), "shakes": -1})
    with pytest.raises(StationSettingsError, match=r"gripper is 'claw', expected one of: 2f-85, 2f-140"):
        SimConfig(gripper="claw")
    with pytest.raises(StationSettingsError, match=r"gripper_stroke_m is 0.085, expected the 0.14 of the gripper 2f-1"):
        SimConfig.from_json({**json.loads(RECORDED), "gripper": "2f-140"})
    with pytest.raises(StationSettingsError, match=r"touches at 0 m/s and yields at -1 N"):
        SimConfig(touch_speed_m_s=0, yield_force_n=-1)
    with pytest.raises(TypeError, match="gravity"):
        SimConfig.from_json({**json.loads(RECORDED), "gravity": 9.81})


def test_a_session_says_which_physics_it_was_under() -> None:
    """One from before there were versions was under the first, and under no other."""
    recorded = json.loads(RECORDED)
    assert recorded_physics(recorded) == PHYSICS_VERSION
    del recorded["physics"]
    assert recorded_physics(recorded) == 1 != PHYSICS_VERSION
