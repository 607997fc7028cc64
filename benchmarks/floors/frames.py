"""Attempts whose pictures look like a camera's: smooth shapes on a table, the noise of a sensor, holes in depth."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from handsight.datasets import PHASES, GraspAttempt, GripperReadings, Outcome, RgbdFrame, SessionHeader

_SHAPES = 8


def rendered_attempts(header: SessionHeader, count: int, rng: np.random.Generator) -> list[GraspAttempt]:
    """Labelled attempts with both pictures, made in memory."""
    return [_attempt(header, number, rng) for number in range(count)]


def _attempt(header: SessionHeader, number: int, rng: np.random.Generator) -> GraspAttempt:
    held = bool(rng.random() < 0.2)
    final_m = 0.03 if held else 0.0
    return GraspAttempt(
        number=number,
        outcome=Outcome.HELD if held else Outcome.EMPTY,
        failure="",
        overhead=_snapshot(header, rng, height_m=0.5),
        pregrasp=_snapshot(header, rng, height_m=0.4),
        pregrasp_x_m=float(rng.uniform(-0.1, 0.1)),
        pregrasp_y_m=float(rng.uniform(-0.1, 0.1)),
        pregrasp_angle_rad=float(rng.uniform(-np.pi, np.pi)),
        pose_base_tool_grasp=np.eye(4),
        contact_force_n=float(rng.uniform(0, 10)),
        gripper=GripperReadings(before_m=0.085, closed_m=final_m, lifted_m=final_m, final_m=final_m),
        scene=None,
        truth_held=held,
        phase_s=rng.uniform(0, 2, len(PHASES)).astype(np.float32),
        started_ns=number,
        elapsed_ns=1,
    )


def _snapshot(header: SessionHeader, rng: np.random.Generator, *, height_m: float) -> RgbdFrame:
    intrinsics = header.station.camera.intrinsics
    size = (intrinsics.width, intrinsics.height)
    coarse = rng.integers(90, 140, (intrinsics.height // 16, intrinsics.width // 16, 3), dtype=np.uint8)
    rgb = cv2.resize(coarse, size, interpolation=cv2.INTER_CUBIC).astype(np.int16)
    plane = height_m / header.station.depth_scale_m
    depth = np.full((intrinsics.height, intrinsics.width), plane, np.float32)
    for _ in range(_SHAPES):
        centre = (int(rng.integers(size[0])), int(rng.integers(size[1])))
        axes = (int(rng.integers(15, 60)), int(rng.integers(15, 60)))
        angle = float(rng.uniform(0, 180))
        cv2.ellipse(rgb, centre, axes, angle, 0, 360, rng.integers(0, 255, 3).tolist(), -1)
        cv2.ellipse(depth, centre, axes, angle, 0, 360, plane - float(rng.uniform(20, 60)), -1)
    rgb += rng.integers(-2, 3, rgb.shape, dtype=np.int16)
    depth += rng.normal(0, 0.7, depth.shape)
    depth[rng.random(depth.shape) < 0.01] = 0
    return RgbdFrame(
        rgb=np.clip(rgb, 0, 255).astype(np.uint8),
        depth=np.clip(np.round(depth), 0, 65535).astype(np.uint16),
        pose_base_tool=np.eye(4),
    )


def png(picture: NDArray[np.generic]) -> bytes:
    """A picture as OpenCV writes it to a PNG file."""
    return bytes(cv2.imencode(".png", np.asarray(picture))[1])
