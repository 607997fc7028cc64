"""Which renderer a session draws with when it may choose: the faster one, measured before the session begins.

What is timed is what an attempt pays for: an emptied world, the objects of one scene loaded into it, one picture. It
is processor time: workers keep every core busy, and what else runs on the machine at that moment must not decide.
"""

from __future__ import annotations

import math
import statistics
import time
from dataclasses import dataclass, replace

import numpy as np

from handsight.collection.errors import StationSettingsError
from handsight.collection.sim.camera import render_objects
from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.objects.catalogue import load_object_set
from handsight.collection.sim.objects.model import ObjectModel
from handsight.collection.sim.renderer import EGL, TINY, EmptyClients, Renderer, check_available
from handsight.servoing.planar import PlanarPose

GAIN = 0.9
"""EGL has to take at most this share of TinyRenderer's time: less is not worth bytes that depend on the driver."""
ROUNDS = 7
LYING_M = 0.05
"""Height at which the objects of the timed scene are put."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RendererChoice:
    """What was chosen, and why."""

    renderer: str
    tiny_s: float
    """Median processor time for one scene [s]; NaN where nothing had to be measured."""
    egl_s: float
    """As ``tiny_s``."""
    reason: str
    """For people."""

    @property
    def measured(self) -> bool:
        """Whether there was anything to choose between."""
        return not math.isnan(self.tiny_s)


def choose_renderer(config: SimConfig) -> RendererChoice:
    """The faster renderer for sessions with this configuration, whatever it names.

    TinyRenderer where EGL does not run or cannot do what the configuration asks for.
    """
    try:
        replace(config, renderer=EGL.name)
        check_available(EGL)
    except StationSettingsError as fault:
        return RendererChoice(renderer=TINY.name, tiny_s=math.nan, egl_s=math.nan, reason=str(fault))
    tiny_s, egl_s = _time(config)
    faster = EGL if egl_s <= GAIN * tiny_s else TINY
    reason = f"a scene takes {1e3 * tiny_s:.1f} ms with {TINY.name!r}, {1e3 * egl_s:.1f} ms with {EGL.name!r}"
    return RendererChoice(renderer=faster.name, tiny_s=tiny_s, egl_s=egl_s, reason=reason)


def _time(config: SimConfig) -> tuple[float, float]:
    """Median times of TinyRenderer and EGL for one scene [s], taken in turns."""
    models = load_object_set(config.objects)[: config.objects_per_scene]
    tiny, egl = EmptyClients(TINY), EmptyClients(EGL)
    try:
        rounds = [(_draw(tiny, TINY, models, config), _draw(egl, EGL, models, config)) for _ in range(ROUNDS)]
    finally:
        tiny.close()
        egl.close()
    # The first round reads files and compiles shaders.
    tiny_s, egl_s = (statistics.median(times) for times in zip(*rounds[1:], strict=True))
    return tiny_s, egl_s


def _draw(clients: EmptyClients, renderer: Renderer, models: tuple[ObjectModel, ...], config: SimConfig) -> float:
    """Load and draw one scene, and return the processor time it took [s]."""
    area = config.workspace
    x_m = np.linspace(area.x_min_m, area.x_max_m, len(models)).tolist()
    y_m = 0.5 * (area.y_min_m + area.y_max_m)
    overhead = PlanarPose(x_m=0.5 * (area.x_min_m + area.x_max_m), y_m=y_m, angle_rad=0.0)
    pose_base_camera = config.camera.pose_base_camera(overhead.pose_base_tool(config.overhead_height_m))
    started = time.process_time()
    bullet = clients.empty()
    for model, x in zip(models, x_m, strict=True):
        bullet.loadURDF(str(model.urdf), (x, y_m, LYING_M), globalScaling=model.scale)
    render_objects(bullet, config.camera.intrinsics, pose_base_camera, renderer=renderer)
    return time.process_time() - started
