"""Servoing: time of a step of every method from picture to decision, against the bare forward passes that it needs."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from benchmarks import Figure
from benchmarks._network import fresh_network, inference_ms
from benchmarks.peers.kornia_warps import by_kornia
from handsight.collection.sim.config import D435_ON_GRIPPER
from handsight.servoing.heatmap import grasp_heatmap
from handsight.servoing.homography import InputGrid
from handsight.servoing.methods.registry import METHODS
from handsight.servoing.objective import Objective
from handsight.servoing.view import View
from handsight.training.scorer import Scorer

THREADS = (1, 2)
PAPER_MS = {"first-order": 47.0, "gauss-newton": 62.0, "second-order": 89.0, "cem-1": 204.0, "cem-5": 985.0}
"""Table I, on a GTX 1080 Ti."""


def run() -> list[Figure]:
    """A step of each method on one thread and on two, and a heatmap; weights of a fresh network take as long as any."""
    threads = torch.get_num_threads()
    try:
        figures = []
        for count in THREADS:
            torch.set_num_threads(count)
            figures += [_step(name, count) for name, method in METHODS.items() if method.settings is not None]
        torch.set_num_threads(1)
        return [*figures, _heatmap()]
    finally:
        torch.set_num_threads(threads)


def _scorer() -> Scorer:
    return Scorer(fresh_network(), InputGrid())


def _view() -> View:
    """A table with boxes on it, and a camera that misses some depth, as a D435 does."""
    k = D435_ON_GRIPPER.intrinsics
    rng = np.random.default_rng(0)
    rgb = np.full((k.height, k.width, 3), 120, np.uint8)
    depth_m = np.full((k.height, k.width), 0.45, np.float32)
    for _ in range(5):
        row, column = int(rng.integers(0, 400)), int(rng.integers(0, 560))
        rgb[row : row + 80, column : column + 60] = rng.integers(0, 256, 3)
        depth_m[row : row + 80, column : column + 60] -= np.float32(0.05)
    depth_m[rng.random(depth_m.shape) < 0.01] = 0
    return View(rgb=rgb, depth_m=depth_m, camera=D435_ON_GRIPPER)


def _step(name: str, threads: int) -> Figure:
    view, scorer, method = _view(), _scorer(), METHODS[name]
    looked_at: list[int] = []

    def step() -> None:
        objective = Objective(view, scorer)
        proposal = method.begin().propose(objective, objective.score_here(), np.random.default_rng(0))
        looked_at.append(len(proposal.scores))

    ours_ms = inference_ms(step)
    settings = method.settings
    batch, passes = getattr(settings, "samples", 0), getattr(settings, "iterations", 1)
    floor_ms = None
    if batch:
        inputs = torch.rand(batch, 4, 64, 64, generator=torch.Generator().manual_seed(0))
        floor_ms = inference_ms(lambda: [scorer(inputs) for _ in range(passes)])
    peers = {}
    if threads == 1 and batch:
        peers["OpenCV warps + forward"] = passes * inference_ms(_by_opencv(view, scorer, batch))
        steps = torch.randn(batch, 3, generator=torch.Generator().manual_seed(0)) * torch.tensor([0.05, 0.05, 0.5])
        peers["kornia warps + forward"] = passes * inference_ms(by_kornia(view, scorer, steps))
    if name in PAPER_MS:
        peers["paper, GTX 1080 Ti"] = PAPER_MS[name]
    return Figure(
        name=f"{name}, {threads} thread{'s' * (threads > 1)}",
        ours=ours_ms,
        floor=floor_ms,
        unit="ms",
        peers=peers,
        n=looked_at[-1],
        what="From picture to decision; floor: the network alone on batches as large, its inputs already there.",
    )


def _by_opencv(view: View, scorer: Scorer, samples: int) -> Callable[[], Tensor]:
    """The homography as a warp of the whole picture, a crop and a resize for each sample."""
    rng = np.random.default_rng(0)
    turns = rng.uniform(-45, 45, samples)
    shifts_px = rng.uniform(-80, 80, (samples, 2))
    depth_m = view.depth_m - np.float32(view.plane_m)
    picture: NDArray[np.float32] = np.dstack([view.rgb.astype(np.float32) / 255, depth_m])
    height, width = depth_m.shape

    def score() -> Tensor:
        inputs = np.empty((samples, 64, 64, 4), np.float32)
        for at in range(samples):
            turn = cv2.getRotationMatrix2D((width / 2, height / 2), float(turns[at]), 1.0)
            turn[:, 2] += shifts_px[at]
            warped = cv2.warpAffine(picture, turn, (width, height), borderMode=cv2.BORDER_REPLICATE)
            cv2.resize(warped[40:440, 120:520], (64, 64), inputs[at], interpolation=cv2.INTER_AREA)
        return scorer(torch.from_numpy(inputs).permute(0, 3, 1, 2).contiguous())

    return score


def _heatmap() -> Figure:
    view, scorer = _view(), _scorer()
    points = grasp_heatmap(view, scorer, spacing_px=6).scores.size

    def crop_by_crop() -> None:
        objective = Objective(view, scorer)
        steps = objective.sweep(0.0).steps.reshape(-1, 3)
        for batch in steps.split(256):
            objective(batch)

    return Figure(
        name="heatmap of every network pixel, 1 thread",
        ours=inference_ms(lambda: grasp_heatmap(view, scorer, spacing_px=6)),
        unit="ms",
        peers={"crop by crop": inference_ms(crop_by_crop, runs=1, warm_up=False)},
        n=points,
        what="All positions of a 640x480 picture at one angle.",
    )
