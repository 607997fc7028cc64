"""Pictures of the whole station: ``handsight collect picture``, and the scene camera of ``handsight servo``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

from handsight.cli.errors import CommandError
from handsight.cli.output import progress_bar
from handsight.cli.wiring.stations import sim_station
from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.scene_camera import SceneCamera
from handsight.collection.sim.station import TABLE_SEED, SimStation
from handsight.collection.sim.table import wooden_table
from handsight.datasets.atomic import atomic_file
from handsight.servoing.planar import PlanarPose

if TYPE_CHECKING:
    from handsight.evaluation.trial import TrialRecording  # PyTorch, which the picture of a station needs not

SHOWN_ANGLE_RAD = 0.35
"""Turns the hand camera towards the scene camera."""
SHOWN_HEIGHT_M = 0.22


def write_station_picture(out: Path, objects: str, seed: int) -> None:
    """Draw a scene of an object set on the station into a PNG file.

    Raises:
        ObjectSetError: There is no such object set.
        CommandError: The picture cannot be encoded.
    """
    picture = station_picture(sim_station(objects).config, seed)
    done, contents = cv2.imencode(".png", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))
    if not done:
        raise CommandError(f"the picture of shape {picture.shape} has no PNG encoding")
    with atomic_file(out) as unfinished:
        unfinished.write_bytes(contents.tobytes())


def station_picture(config: SimConfig, seed: int) -> NDArray[np.uint8]:
    """A settled scene with the gripper over one of its objects. Shape (H, W, 3)."""
    station = SimStation(config)
    try:
        scene = station.reset(np.random.default_rng(seed))
    finally:
        station.close()
    x_m, y_m = scene.pose_base_object[scene.target, :2].tolist()
    tool = PlanarPose(x_m=x_m, y_m=y_m, angle_rad=SHOWN_ANGLE_RAD)
    camera = _scene_camera(config)
    try:
        return camera.picture(tool.pose_base_tool(SHOWN_HEIGHT_M), config.gripper_stroke_m, scene)
    finally:
        camera.close()


def servo_pictures(config: SimConfig, recording: TrialRecording) -> list[NDArray[np.uint8]]:
    """The station from outside at every step of a trial on it, each (H, W, 3). Nothing is touched while servoing."""
    scene, steps = recording.scene, recording.trace.steps
    if scene is None:
        return []
    camera = _scene_camera(config)
    pictures = []
    try:
        with progress_bar("pictures", len(steps)) as bar:
            for step in steps:
                pose_base_tool = step.pose.pose_base_tool(recording.station.pregrasp_height_m)
                pictures.append(camera.picture(pose_base_tool, recording.station.gripper_stroke_m, scene))
                bar.advance()
    finally:
        camera.close()
    return pictures


def _scene_camera(config: SimConfig) -> SceneCamera:
    return SceneCamera(config, wooden_table(np.random.default_rng(TABLE_SEED)))
