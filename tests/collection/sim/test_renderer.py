"""EGL draws what TinyRenderer draws, and forgets what it drew before."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from tests.support.alignment import FULL, INNER, SKEWED, look, shift_px, write_textured_square
from tests.support.egl import NO_EGL

from handsight.collection.attempt import attempt_seed, run_attempt
from handsight.collection.errors import RendererUnavailableError, StationSettingsError
from handsight.collection.policy import UniformPolicy
from handsight.collection.sim import renderer as renderer_module
from handsight.collection.sim import renderer_choice
from handsight.collection.sim.bullet import BulletClient, quiet
from handsight.collection.sim.bullet import pybullet as pb
from handsight.collection.sim.camera import Light, render_objects
from handsight.collection.sim.config import D435_ON_GRIPPER, SimConfig
from handsight.collection.sim.renderer import (
    EGL,
    TINY,
    EmptyClients,
    Renderer,
    check_available,
    open_client,
    renderer_named,
)
from handsight.collection.sim.station import SimStation
from handsight.datasets.records import GraspAttempt, RgbdFrame
from handsight.servoing.camera import HandCamera
from handsight.servoing.homography import predict_inputs
from handsight.servoing.planar import PlanarPose, PlanarStep
from handsight.servoing.prepared_view import PreparedView


@pytest.fixture(scope="module")
def textured_plane(egl: Renderer, tmp_path_factory: pytest.TempPathFactory) -> Iterator[BulletClient]:
    """A plane at z = 0 with a smooth random texture, in a Bullet client that draws with EGL."""
    bullet = open_client(egl)
    square = write_textured_square(tmp_path_factory.mktemp("plane"))
    bullet.createMultiBody(0, -1, bullet.createVisualShape(pb.GEOM_MESH, fileName=str(square)), (0.6, 0.0, 0.0))
    yield bullet
    with quiet():
        bullet.disconnect()


def _inner(view: PreparedView, step: torch.Tensor) -> NDArray[np.float32]:
    gray: NDArray[np.float32] = predict_inputs(view, step, grid=FULL)[0, :3].mean(0).numpy()
    return gray[INNER, INNER]


@pytest.mark.parametrize("camera", [D435_ON_GRIPPER, SKEWED], ids=["d435", "skewed"])
@settings(max_examples=12, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    dx_m=st.floats(-0.04, 0.04),
    dy_m=st.floats(-0.04, 0.04),
    dangle_rad=st.floats(-0.5, 0.5),
    angle_rad=st.floats(-1.5, 1.5),
)
def test_pictures_agree_with_the_homography_to_a_twentieth_of_a_pixel(
    textured_plane: BulletClient, camera: HandCamera, dx_m: float, dy_m: float, dangle_rad: float, angle_rad: float
) -> None:
    before = PlanarPose(x_m=0.62, y_m=0.01, angle_rad=angle_rad)
    after = before.after(PlanarStep(dx_m=dx_m, dy_m=dy_m, dangle_rad=dangle_rad))
    predicted = _inner(look(textured_plane, camera, before, renderer=EGL), torch.tensor([[dx_m, dy_m, dangle_rad]]))
    seen = _inner(look(textured_plane, camera, after, renderer=EGL), torch.zeros(1, 3))
    assert shift_px(predicted, seen) < 0.05


def test_depth_of_a_plane_is_exact_to_a_tenth_of_a_millimetre(textured_plane: BulletClient) -> None:
    """The plugin's depth buffer has 16 bits with Mesa; a dataset's unit is a whole millimetre."""
    k = SKEWED.intrinsics
    pose_base_camera = SKEWED.pose_base_camera(PlanarPose(x_m=0.6, y_m=0.0, angle_rad=0.3).pose_base_tool(0.4))
    _, depth_m = render_objects(textured_plane, k, pose_base_camera, renderer=EGL)
    np.testing.assert_allclose(depth_m, 0.52, atol=1e-4)


@pytest.fixture(scope="module")
def overheads(egl: Renderer) -> dict[str, list[RgbdFrame]]:
    """The same five scenes, with objects in other colours, drawn by both."""
    frames: dict[str, list[RgbdFrame]] = {}
    for renderer in (TINY, egl):
        station = SimStation(SimConfig(renderer=renderer.name, vary=("colour",)))
        for seed in range(5):
            station.reset(np.random.default_rng(seed))
            frames.setdefault(renderer.name, []).append(station.look())
        station.close()
    return frames


def test_both_measure_the_same_scene(overheads: dict[str, list[RgbdFrame]]) -> None:
    for tiny, egl in zip(overheads["tiny"], overheads["egl"], strict=True):
        far_apart = np.abs(tiny.depth.astype(int) - egl.depth) > 1
        assert far_apart.sum() <= 30  # on edges, of more than 20,000 pixels of objects


def test_both_show_the_same_colours(overheads: dict[str, list[RgbdFrame]]) -> None:
    for tiny, egl in zip(overheads["tiny"], overheads["egl"], strict=True):
        levels = np.abs(tiny.rgb.astype(int) - egl.rgb).max(axis=2)
        both_see_table = (tiny.depth == 600) & (egl.depth == 600)
        assert levels[both_see_table].max() == 0
        assert np.median(levels[(tiny.depth < 590) & (egl.depth < 590)]) < 15


def _digest(attempt: GraspAttempt) -> tuple[str, ...]:
    assert attempt.overhead is not None
    return tuple(hashlib.sha256(part.tobytes()).hexdigest() for part in (attempt.overhead.rgb, attempt.overhead.depth))


def test_an_attempt_does_not_depend_on_what_was_drawn_before(egl: Renderer) -> None:
    def run(station: SimStation, number: int) -> GraspAttempt:
        return run_attempt(station, UniformPolicy(), number, attempt_seed(5, number), pregrasp_picture=False)

    worn, fresh = (SimStation(SimConfig(renderer=egl.name)) for _ in range(2))
    earlier = [run(worn, number) for number in range(4)]
    again = run(fresh, 3)
    assert _digest(again) == _digest(earlier[3])
    assert again.outcome == earlier[3].outcome
    worn.close()
    fresh.close()


def test_a_renewed_engine_draws_the_same(egl: Renderer) -> None:
    pose_base_camera = D435_ON_GRIPPER.pose_base_camera(PlanarPose(x_m=0.6, y_m=0.0, angle_rad=0.0).pose_base_tool(0.4))
    clients = EmptyClients(replace(egl, attempts_per_client=2))
    pictures, seen = [], []
    for _ in range(5):
        bullet = clients.empty()
        assert bullet.getNumBodies() == 0
        shape = bullet.createVisualShape(pb.GEOM_BOX, halfExtents=(0.03, 0.03, 0.03), rgbaColor=(0.8, 0.2, 0.1, 1))
        bullet.createMultiBody(0, -1, shape, (0.6, 0.0, 0.03))
        pictures.append(render_objects(bullet, D435_ON_GRIPPER.intrinsics, pose_base_camera, renderer=egl)[0])
        seen.append(bullet)
    clients.close()
    assert [seen[i] is seen[i + 1] for i in range(4)] == [True, False, True, False]
    for picture in pictures:
        np.testing.assert_array_equal(picture, pictures[0])


def test_shadows_do_not_depend_on_how_long_the_light_is_given(egl: Renderer) -> None:
    """The plugin takes the direction for a place and casts shadows near it."""
    pose_base_camera = D435_ON_GRIPPER.pose_base_camera(PlanarPose(x_m=0.6, y_m=0.0, angle_rad=0.0).pose_base_tool(0.4))
    bullet = open_client(egl)
    for height_m in (0.03, 0.2):
        shape = bullet.createVisualShape(pb.GEOM_SPHERE, radius=0.03)
        bullet.createMultiBody(0, -1, shape, (0.6, height_m / 2, height_m))
    views = [
        render_objects(
            bullet, D435_ON_GRIPPER.intrinsics, pose_base_camera, light=Light(direction=direction), renderer=egl
        )[0]
        for direction in ((0.3, 0.4, 1.0), (3.0, 4.0, 10.0))
    ]
    with quiet():
        bullet.disconnect()
    np.testing.assert_array_equal(views[0], views[1])


def test_the_plugin_says_nothing(egl: Renderer) -> None:
    """Whatever it prints would be in the JSON of a command; even when Python leaves with a Bullet client open."""
    code = (
        "from handsight.collection.sim.renderer import *\n"
        "from handsight.collection.sim.renderer import EGL\n"
        "first, left_open = EmptyClients(EGL), EmptyClients(EGL)\n"
        "first.empty().getCameraImage(64, 48, renderer=EGL.flag)\n"
        "first.close()\n"
        "left_open.empty().getCameraImage(64, 48, renderer=EGL.flag)\n"
    )
    run = subprocess.run([sys.executable, "-P", "-c", code], capture_output=True, text=True, check=False)
    assert (run.returncode, run.stdout, run.stderr) == (0, "", "")


@pytest.mark.usefixtures("no_egl")
def test_without_egl_the_message_names_the_packages_and_the_other_renderer() -> None:
    with pytest.raises(RendererUnavailableError, match=r"libegl1 libgl1-mesa-dri.*'tiny'"):
        SimStation(SimConfig(renderer="egl"))


def test_what_egl_cannot_do_is_refused_before_anything_starts() -> None:
    large = replace(D435_ON_GRIPPER, intrinsics=replace(D435_ON_GRIPPER.intrinsics, width=1280, height=720))
    with pytest.raises(StationSettingsError, match=r"1280x720 .* at most 1024x768.*; vary has 'light'"):
        SimConfig(renderer="egl", camera=large, vary=("light",))
    assert renderer_choice.choose_renderer(SimConfig(vary=("light",))).renderer == "tiny"


def test_unknown_renderers_are_refused() -> None:
    with pytest.raises(StationSettingsError, match="'vulkan', expected one of: tiny, egl"):
        SimConfig(renderer="vulkan")
    with pytest.raises(StationSettingsError, match="'vulkan', expected one of: tiny, egl"):
        renderer_named("vulkan")


def test_a_driver_that_is_missing_does_not_take_the_process_down() -> None:
    """Asked directly, the plugin ends the process; that is what the trial process is for."""
    code = (
        "from handsight.collection.errors import RendererUnavailableError\n"
        "from handsight.collection.sim.renderer import EGL, open_client\n"
        "try:\n    open_client(EGL)\nexcept RendererUnavailableError:\n    print('still here')\n"
    )
    run = subprocess.run(
        [sys.executable, "-P", "-c", code], capture_output=True, text=True, env=os.environ | NO_EGL, check=False
    )
    assert run.stdout == "still here\n", run.stderr


def test_folder_of_the_trial_is_no_danger(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, egl: Renderer) -> None:
    """The trial process does not import what happens to lie in the working folder."""
    (tmp_path / "pybullet.py").write_text("raise SystemExit(9)\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    renderer_module._egl_fault.cache_clear()
    check_available(egl)
