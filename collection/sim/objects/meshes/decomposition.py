"""Cuts solids into convex parts with CoACD (Wei et al., ACM Transactions on Graphics 41(4), 2022)."""

from __future__ import annotations

import os
import signal
from concurrent.futures import BrokenExecutor, Executor
from contextlib import suppress
from types import TracebackType

import coacd
import numpy as np
import trimesh
from numpy.typing import NDArray

from handsight.collection.sim.objects.meshes.fault import MeshFault
from handsight.collection.sim.objects.meshes.solid import Solid
from handsight.collection.sim.objects.wavefront import ConvexPart
from handsight.jobs.engine import LOCAL

MAX_PARTS = 12
MAX_PART_VERTICES = 32
"""Both keep physics as fast as with the sets that come with handsight."""
CONCAVITY = 0.05
"""CoACD's own default: how far, relative to the object's size, parts may bridge a hollow."""
MIN_PART_M3 = 1e-12
"""A tenth of a millimetre cubed: smaller parts are noise of the cutting."""
LIMIT_S = 300.0
"""Ordinary meshes take seconds; some surfaces that run through themselves take hours."""

coacd.set_log_level("error")


class Cutter:
    """Cuts one surface after the other, in a process of its own.

    CoACD cannot be stopped, neither by Ctrl-C nor after a time, and ends its process where it fails: none of that
    should happen to the process that has an import in hand.
    """

    def __init__(self, limit_s: float = LIMIT_S) -> None:
        """Give up a surface after ``limit_s``."""
        self._limit_s = limit_s
        self._worker: tuple[Executor, int] | None = None

    def __enter__(self) -> Cutter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._stop()

    def convex_parts(self, solid: Solid) -> list[ConvexPart]:
        """The parts of all bodies of a solid; the same on every call.

        Each body is cut by itself: where two of them overlap or nearly touch, CoACD would cut for minutes.

        Raises:
            MeshFault: CoACD fails over it, takes too long, or finds nothing that encloses anything.
        """
        share = max(1, MAX_PARTS // len(solid.bodies))
        parts = [part for body in solid.bodies for part in self._cut(body, share)]
        # Flat parts weigh nothing, and without any weight there is no centre of mass.
        heavy = [part for part in parts if np.linalg.det(part.vertices_m[part.triangles]).sum() / 6 > MIN_PART_M3]
        if not heavy:
            raise MeshFault("cannot be cut into convex parts that enclose anything; repair or leave out the mesh")
        return heavy

    def _cut(self, body: trimesh.Trimesh, most_parts: int) -> list[ConvexPart]:
        if self._worker is None:
            executor = LOCAL.start_worker()
            self._worker = executor, executor.submit(_ready).result()
        vertices_m, triangles = np.asarray(body.vertices), np.asarray(body.faces)
        try:
            pieces = self._worker[0].submit(_run_coacd, vertices_m, triangles, most_parts).result(self._limit_s)
        except TimeoutError as error:
            self._stop()
            raise MeshFault(
                f"takes CoACD more than {self._limit_s:g} s to cut into convex parts; does it run through itself? "
                "Simplify it"
            ) from error
        except BrokenExecutor as error:
            self._stop()
            raise MeshFault("makes CoACD crash; repair or leave out the mesh") from error
        return [ConvexPart(vertices_m=corners, triangles=faces) for corners, faces in pieces]

    def _stop(self) -> None:
        if self._worker is None:
            return
        (executor, process), self._worker = self._worker, None
        with suppress(ProcessLookupError):
            os.kill(process, signal.SIGKILL)
        executor.shutdown(wait=True, cancel_futures=True)


def _ready() -> int:
    """The process that answers; by then it has imported all that it needs, which is no time of any mesh."""
    return os.getpid()


def _run_coacd(
    vertices_m: NDArray[np.float64], triangles: NDArray[np.int64], most_parts: int
) -> list[tuple[NDArray[np.float64], NDArray[np.int64]]]:
    pieces = coacd.run_coacd(
        coacd.Mesh(vertices_m, triangles),
        threshold=CONCAVITY,
        max_convex_hull=most_parts,
        decimate=True,
        max_ch_vertex=MAX_PART_VERTICES,
        # A smaller search than CoACD's default: a beaker takes 4 s, not 9, and its walls come out a twentieth thicker.
        mcts_iterations=60,
        mcts_nodes=12,
        resolution=1000,
        seed=0,
    )
    return [(np.asarray(corners, np.float64), np.asarray(faces, np.int64)) for corners, faces in pieces]
