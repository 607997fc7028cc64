"""Who draws the objects: PyBullet's own TinyRenderer, or its EGL plugin on OpenGL without a display.

TinyRenderer draws the same bytes on every machine. OpenGL is faster where it is good, and its bytes depend on the
driver, so a session records which of the two made its pictures (``SimConfig.renderer``).

The plugin takes its process down when EGL cannot be started, and never lets go of a texture until its client ends. The
first is why a process of its own tries it, the second why :class:`EmptyClients` replaces clients now and then. It also
takes a mesh that is loaded at a second scale for the first: no object set does that.
"""

from __future__ import annotations

import math
import os
import subprocess
import sys
import weakref
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec

from handsight.collection.errors import RendererUnavailableError, StationSettingsError
from handsight.collection.sim.bullet import BulletClient, connect, pybullet, quiet
from handsight.jobs.processes import bound_command

EGL_MODULE = "eglRenderer"
EGL_ENTRY_POINT = "_eglRendererPlugin"
TRIAL = """
import sys
import pybullet
bullet = pybullet.connect(pybullet.DIRECT)
sys.exit(0 if pybullet.loadPlugin(*sys.argv[1:], physicsClientId=bullet) >= 0 else 3)
"""
TRIAL_LIMIT_S = 60.0
"""A driver that has not answered by then never will."""
WARM_UP_FRAMES = 2
"""So many pictures of a Bullet client name the driver on standard output."""
IDENTITY = (1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Renderer:
    """One way of drawing, and how its pictures differ from the other's."""

    name: str
    flag: int
    """PyBullet's constant."""
    sampled_px: tuple[float, float]
    """Where a pixel is sampled, from its left and its upper edge [px]."""
    needs_egl: bool = False
    """Whether it is the plugin, which not every machine can run."""
    largest_px: tuple[int, int] | None = None
    """Width and height of the largest picture; None without a limit."""
    coloured_light: bool = True
    """Whether ambient and diffuse light can be chosen, or the direction alone."""
    attempts_per_client: int | None = None
    """How many worlds a Bullet client may hold one after the other; None without a limit."""
    lamp_m: float | None = None
    """Distance at which the lamp is put; None where only its direction is asked for."""

    def lamp(self, direction: tuple[float, float, float]) -> tuple[float, float, float]:
        """How the renderer wants to be told where the light comes from."""
        if self.lamp_m is None:
            return direction
        x, y, z = direction
        stretch = self.lamp_m / math.hypot(x, y, z)
        return stretch * x, stretch * y, stretch * z


TINY = Renderer(name="tiny", flag=pybullet.ER_TINY_RENDERER, sampled_px=(0.0, 1.0))
EGL = Renderer(
    name="egl",
    flag=pybullet.ER_BULLET_HARDWARE_OPENGL,
    sampled_px=(0.5, 0.5),
    needs_egl=True,
    # Of the plugin's window. Larger pictures would come back as enlarged ones.
    largest_px=(1024, 768),
    coloured_light=False,
    # Five household objects leave 0.45 MB of textures behind; a new engine takes 0.25 s.
    attempts_per_client=128,
    # The plugin always casts shadows, within some hundred metres of the lamp.
    lamp_m=1000.0,
)
RENDERERS = {renderer.name: renderer for renderer in (TINY, EGL)}


def renderer_named(name: str) -> Renderer:
    """The renderer of that name.

    Raises:
        StationSettingsError: There is none.
    """
    if name not in RENDERERS:
        raise StationSettingsError(f"renderer is {name!r}, expected one of: {', '.join(RENDERERS)}")
    return RENDERERS[name]


def check_available(renderer: Renderer) -> None:
    """Make sure that this machine can draw with ``renderer``.

    Raises:
        RendererUnavailableError: It cannot; the message says why.
    """
    fault = _egl_fault() if renderer.needs_egl else ""
    if fault:
        raise RendererUnavailableError(
            f"the renderer {renderer.name!r} does not run on this machine ({fault}): install a GPU driver with EGL or "
            f"Mesa (Debian and Ubuntu: apt-get install libegl1 libgl1-mesa-dri), or use the renderer {TINY.name!r}"
        )


@cache
def _egl_fault() -> str:
    """Why the plugin does not run; empty when it does. Tried once in each process."""
    plugin = _egl_plugin()
    if plugin is None:
        return "this build of PyBullet has no EGL plugin"
    command = bound_command([sys.executable, "-P", "-c", TRIAL, plugin, EGL_ENTRY_POINT])
    try:
        trial = subprocess.run(command, capture_output=True, text=True, timeout=TRIAL_LIMIT_S, check=False)
    except subprocess.TimeoutExpired:
        return f"EGL did not start within {TRIAL_LIMIT_S:g} s"
    if trial.returncode == 0:
        return ""
    said = trial.stderr.strip().splitlines()
    return said[-1] if said else f"its trial ended with status {trial.returncode}"


def _egl_plugin() -> str | None:
    """The plugin's library, which the wheel of PyBullet installs as a module that nobody can import."""
    spec = find_spec(EGL_MODULE)
    return spec.origin if spec else None


def open_client(renderer: Renderer) -> BulletClient:
    """A headless client of its own whose pictures ``renderer`` draws.

    Raises:
        RendererUnavailableError: This machine cannot draw with it.
    """
    check_available(renderer)
    bullet = connect()
    if renderer.needs_egl:
        # Mesa would draw on every core, and the workers of a session would only wait for each other.
        os.environ.setdefault("LP_NUM_THREADS", "0")
        with quiet():
            bullet.loadPlugin(_egl_plugin(), EGL_ENTRY_POINT)
            for _ in range(WARM_UP_FRAMES):
                bullet.getCameraImage(16, 16, IDENTITY, IDENTITY, renderer=renderer.flag)
    return bullet


class EmptyClients:
    """One client after the other, each as empty as the first."""

    def __init__(self, renderer: Renderer) -> None:
        """Start the first.

        Raises:
            RendererUnavailableError: This machine cannot draw with ``renderer``.
        """
        self._renderer = renderer
        self._start()

    def _start(self) -> None:
        self._bullet = open_client(self._renderer)
        # The plugin prints on exit to standard output, even when the interpreter ends with the client still open.
        self._stop = weakref.finalize(self, _stop_quietly, self._bullet)
        self._used = 0

    def empty(self) -> BulletClient:
        """A Bullet client without bodies; the one given out before must not be used any more."""
        if self._used == self._renderer.attempts_per_client:
            self.close()
            self._start()
        self._used += 1
        self._bullet.resetSimulation()
        return self._bullet

    def close(self) -> None:
        """Stop the client."""
        self._stop()


def _stop_quietly(bullet: BulletClient) -> None:
    with quiet():
        bullet.disconnect()
