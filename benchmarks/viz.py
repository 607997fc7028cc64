"""Seeing: heatmaps at one angle and at all, a trace, what watching costs, browsing 30,000 attempts."""

from __future__ import annotations

import math
import os
import statistics
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import torch

from benchmarks import Figure
from benchmarks._browsing import browsing_figures
from benchmarks._network import fresh_network, inference_ms
from handsight.collection.sim.arm_shape import Ur10Shape
from handsight.collection.sim.config import D435_ON_GRIPPER, SimConfig
from handsight.collection.sim.station import SimStation
from handsight.evaluation.trial import TrialRecording, run_trial
from handsight.evaluation.watching import TrialStart, TrialWatcher
from handsight.servoing.angle_maps import angle_maps
from handsight.servoing.camera import HandCamera
from handsight.servoing.heatmap import Heatmap, grasp_heatmap
from handsight.servoing.homography import InputGrid
from handsight.servoing.loop import ServoSettings, ServoStep
from handsight.servoing.objective import Objective
from handsight.servoing.view import View
from handsight.training.scorer import Scorer

SIDE_PX = 640
"""Of the picture whose heatmap is 100 x 100 at one point for each network pixel of 6.25 raw ones."""
SPACING_PX = 6
TURN_RAD = math.radians(20)
ANGLES = 18
STEPS = 12
METHOD = "first-order"
TRIALS, REPEATS = 2, 5
"""Trials, and how often each is run with and without a viewer."""


def run() -> list[Figure]:
    """All on one thread; weights of a fresh network take as long as those of a trained one."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    os.environ.setdefault("RUST_LOG", "off")
    try:
        with tempfile.TemporaryDirectory(prefix="handsight-bench-") as folder:
            return [*_heatmaps(), *_recordings(), *browsing_figures(Path(folder))]
    finally:
        torch.set_num_threads(threads)


def _heatmaps() -> list[Figure]:
    view, scorer = _square_view(), Scorer(fresh_network(), InputGrid())
    objective = Objective(view, scorer)
    straight = grasp_heatmap(view, scorer, spacing_px=SPACING_PX)
    brute_ms = inference_ms(lambda: _brute_force(objective, 0.0), runs=3)
    turned_ms = inference_ms(lambda: objective.sweep(TURN_RAD))
    rows, columns = straight.scores.shape
    return [
        Figure(
            name=f"heatmap {rows}x{columns}, one angle",
            ours=inference_ms(lambda: grasp_heatmap(view, scorer, spacing_px=SPACING_PX)),
            floor=_network_alone_ms(objective, scorer, 0.0),
            unit="ms",
            peers={"brute force": brute_ms},
            n=straight.scores.size,
            what="Picture to map; floor: the network alone on the picture, resampled; peer: the crop of each point.",
        ),
        Figure(
            name=f"the same, turned by {math.degrees(TURN_RAD):.0f} deg",
            ours=turned_ms,
            floor=_network_alone_ms(objective, scorer, TURN_RAD),
            unit="ms",
            peers={"brute force": brute_ms},
            n=objective.sweep(TURN_RAD).scores.numel(),
            what="A turned lattice that covers the picture has more points, those in its corners beside it.",
        ),
        Figure(
            name=f"heatmap {rows}x{columns}, {ANGLES} angles",
            ours=inference_ms(lambda: angle_maps(view, scorer, angles=ANGLES, spacing_px=SPACING_PX), runs=3),
            floor=ANGLES * turned_ms,
            unit="ms",
            peers={"brute force, one angle": brute_ms},
            n=ANGLES * straight.scores.size,
            what=f"Picture to maps of all angles on the picture's raster; floor: {ANGLES} turned sweeps.",
        ),
    ]


def _brute_force(objective: Objective, angle_rad: float) -> None:
    for batch in objective.sweep(angle_rad).steps.reshape(-1, 3).split(256):
        objective(batch)


def _network_alone_ms(objective: Objective, scorer: Scorer, angle_rad: float) -> float:
    rows, columns = objective.sweep(angle_rad).scores.shape
    size_px = scorer.grid.size_px
    generator = torch.Generator().manual_seed(0)
    picture = torch.rand(4, rows - 1 + size_px, columns - 1 + size_px, generator=generator)
    return inference_ms(lambda: scorer.score_map(picture))


def _square_view() -> View:
    """Boxes on a table, and a camera that misses some depth."""
    k = replace(
        D435_ON_GRIPPER.intrinsics, width=SIDE_PX, height=SIDE_PX, cx=0.5 * (SIDE_PX - 1), cy=0.5 * (SIDE_PX - 1)
    )
    camera: HandCamera = replace(D435_ON_GRIPPER, intrinsics=k)
    rng = np.random.default_rng(0)
    rgb = rng.integers(100, 140, (SIDE_PX, SIDE_PX, 3), dtype=np.uint8)
    depth_m = np.full((SIDE_PX, SIDE_PX), 0.45, np.float32)
    for _ in range(5):
        row, column = (int(rng.integers(0, SIDE_PX - 80)) for _ in range(2))
        rgb[row : row + 80, column : column + 60] = rng.integers(0, 256, 3)
        depth_m[row : row + 80, column : column + 60] -= np.float32(0.05)
    depth_m[rng.random(depth_m.shape) < 0.01] = 0
    return View(rgb=rgb, depth_m=depth_m, camera=camera)


def _recordings() -> list[Figure]:
    station = SimStation(SimConfig(objects="household-test"))
    scorer = Scorer(fresh_network(), InputGrid())
    try:
        return [_trace(station, scorer), *_live(station, scorer)]
    finally:
        station.close()


def _trial(station: SimStation, scorer: Scorer, number: int, watcher: TrialWatcher | None = None) -> TrialRecording:
    # No score reaches the threshold, so that every step of the method is taken.
    settings = ServoSettings(threshold=1.0)
    _, recording = run_trial(station, scorer, METHOD, number, seed=1, settings=settings, watcher=watcher)
    if recording is None:
        raise RuntimeError(f"trial {number} was aborted, expected one that servoes")
    return recording


def _trace(station: SimStation, scorer: Scorer) -> Figure:
    """A file of so many steps, with a heatmap for each and the arm."""
    from handsight.viz.recordings.servo_trace import write_servo_trace

    recording = _trial(station, scorer, 0)
    trace = replace(recording.trace, steps=recording.trace.steps[:STEPS])
    heatmaps: list[Heatmap] = [grasp_heatmap(step.view, scorer) for step in trace.steps]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "trace.rrd"
        write_servo_trace(path, replace(recording, trace=trace), heatmaps, arm=Ur10Shape())
        ours_mb = path.stat().st_size / 1e6
    view = trace.steps[0].view
    raw_mb = STEPS * (view.rgb.nbytes + view.depth_m.size * 2) / 1e6
    return Figure(
        name=f"servo trace of {STEPS} steps",
        ours=ours_mb,
        unit="MB",
        peers={"the pictures alone, raw": raw_mb},
        n=STEPS,
        what="File with pictures, depth, heatmaps, samples, network inputs and the arm; goal: 3 MB.",
    )


@dataclass
class _HandingOver:
    """A watcher that takes the time for which a servo run is held up by another."""

    watcher: TrialWatcher
    held_up_s: list[float] = field(default_factory=list)

    def begin(self, start: TrialStart) -> None:
        self.watcher.begin(start)

    def step(self, step: ServoStep) -> None:
        began = time.perf_counter()
        self.watcher.step(step)
        self.held_up_s.append(time.perf_counter() - began)

    def end(self, recording: TrialRecording | None) -> None:
        self.watcher.end(recording)

    def close(self) -> None:
        self.watcher.close()


@dataclass
class _Clock:
    """A watcher that takes the time from step to step, and shows them to another."""

    watcher: TrialWatcher | None
    times_s: list[float] = field(default_factory=list)
    _before_s: float | None = None

    def begin(self, start: TrialStart) -> None:
        self._before_s = None
        if self.watcher is not None:
            self.watcher.begin(start)

    def step(self, step: ServoStep) -> None:
        now_s = time.perf_counter()
        if self._before_s is not None:
            self.times_s.append(now_s - self._before_s)
        self._before_s = now_s
        if self.watcher is not None:
            self.watcher.step(step)

    def end(self, recording: TrialRecording | None) -> None:
        if self.watcher is not None:
            self.watcher.end(recording)

    def close(self) -> None:
        if self.watcher is not None:
            self.watcher.close()


def _live(station: SimStation, scorer: Scorer) -> list[Figure]:
    """How much longer steps take while a viewer watches, and how long each is held up.

    The same trials are run several times with and without, in turn, and the least time of each step is taken: what else
    the machine does then counts on neither side.
    """
    from handsight.viz.recordings.live import LiveTrace

    bare: list[list[list[float]]] = [[] for _ in range(TRIALS)]
    watched: list[list[list[float]]] = [[] for _ in range(TRIALS)]
    with _receiver() as url:
        live = LiveTrace(url, arm=Ur10Shape())
        over = _HandingOver(live)
        # While a run loads its network the program that shows steps starts.
        live.started.wait()
        for repeat in range(REPEATS * TRIALS):
            number = repeat % TRIALS
            alone, clock = _Clock(None), _Clock(over)
            _trial(station, scorer, number, alone)
            bare[number].append(alone.times_s)
            _trial(station, scorer, number, clock)
            watched[number].append(clock.times_s)
        live.close()
        if live.gone:
            raise RuntimeError("the receiver stopped answering, expected it to take everything")
    bare_ms, watched_ms = (1e3 * float(np.mean([np.min(runs, axis=0) for runs in some])) for some in (bare, watched))
    return [
        Figure(
            name="live logging, share of a step",
            ours=100 * (watched_ms / bare_ms - 1),
            floor=100 * 1e3 * statistics.median(over.held_up_s) / bare_ms,
            unit="%",
            n=REPEATS * TRIALS,
            what="How much longer steps of the same trials take while they are streamed; floor: handing them over.",
        ),
        Figure(
            name="servo step, streamed",
            ours=watched_ms,
            floor=bare_ms,
            unit="ms",
            peers={"steps dropped": live.dropped},
            n=REPEATS * TRIALS,
            what=f"From step to step of {METHOD} on the simulated station; floor: the same trials unwatched.",
        ),
    ]


@contextmanager
def _receiver() -> Iterator[str]:
    """A server in a process of its own that takes streams as a viewer does, and draws nothing."""
    from handsight.viz.recordings.viewer_process import free_port, running_viewer

    port = free_port()
    arguments = ["--serve-grpc", "--bind", "127.0.0.1", "--port", str(port), "--server-memory-limit", "500MB"]
    with running_viewer(arguments, port):
        yield f"rerun+http://127.0.0.1:{port}/proxy"
