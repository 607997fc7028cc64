"""Seeded attempts of every kind, and a program that records them for the tests that need another process.

Run as ``python -P factories.py PATH SEED ATTEMPTS EVERY`` it waits for a line on its standard input, records the
session in commits of EVERY attempts, and prints each attempt's number as it is appended and each commit once it is
acknowledged.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from handsight.datasets import (
    PHASES,
    GraspAttempt,
    GraspRepository,
    GripperReadings,
    Outcome,
    RgbdFrame,
    SceneObjects,
    SessionHeader,
    SessionWriter,
    StationSpec,
)
from handsight.servoing.camera import HandCamera, Intrinsics

OBJECTS = ("apple", "bolt", "cup", "duck", "egg")
CLOSED_WIDTH_M = 0.002


def make_station(*, width: int = 8, height: int = 6, **changes: Any) -> StationSpec:
    camera = HandCamera(
        intrinsics=Intrinsics.from_vertical_fov(width=width, height=height, fov_y_rad=0.73),
        x_tool_camera_m=0.001,
        y_tool_camera_m=-0.071,
        z_tool_camera_m=-0.113,
    )
    values: dict[str, Any] = {
        "source": "sim",
        "camera": camera,
        "depth_scale_m": 1e-3,
        "gripper_stroke_m": 0.085,
        "closed_width_m": CLOSED_WIDTH_M,
        "objects": OBJECTS,
        "conditions": ("table_friction", "light_ambient"),
        "serials": {"camera": "D435-1"},
    }
    return StationSpec(**{**values, **changes})


def make_header(*, seed: int | None = 1, objects_per_scene: int = 3, **station: Any) -> SessionHeader:
    config = {"shakes": 3, "height_m": 0.4, "names": ["a", "é"]}
    return SessionHeader(station=make_station(**station), seed=seed, objects_per_scene=objects_per_scene, config=config)


def make_attempt(header: SessionHeader, number: int, *, outcome: Outcome | None = None) -> GraspAttempt:
    """Attempt ``number`` of the session, which it determines together with the seed, as in a simulation."""
    rng = np.random.default_rng([header.seed or 0, number])
    chosen = Outcome(int(rng.integers(len(Outcome)))) if outcome is None else outcome
    labelled = chosen in (Outcome.EMPTY, Outcome.HELD)
    looked = labelled or bool(rng.integers(4))
    reached = labelled or (looked and bool(rng.integers(2)))
    final_m = float(rng.uniform(0, CLOSED_WIDTH_M) if chosen is Outcome.EMPTY else rng.uniform(0.003, 0.085))
    return GraspAttempt(
        number=number,
        outcome=chosen,
        failure="" if labelled else f"{rng.choice(PHASES)}: joint {rng.integers(6)} at its limit, δ = {rng.random()}",
        overhead=make_snapshot(header, rng) if looked else None,
        pregrasp=make_snapshot(header, rng) if reached else None,
        pregrasp_x_m=float(rng.normal()) if looked else float("nan"),
        pregrasp_y_m=float(rng.normal()) if looked else float("nan"),
        pregrasp_angle_rad=float(rng.normal()) if looked else float("nan"),
        pose_base_tool_grasp=make_pose(rng) if labelled else np.full((4, 4), np.nan),
        contact_force_n=float(rng.choice([0.0, rng.uniform(0, 30)])),
        gripper=GripperReadings(
            before_m=0.085,
            closed_m=float(rng.uniform(0, 0.085)) if labelled else float("nan"),
            lifted_m=float(rng.uniform(0, 0.085)) if labelled else float("nan"),
            final_m=final_m if labelled else float("nan"),
        ),
        scene=make_scene(header, rng) if rng.integers(5) else None,
        truth_held=bool(rng.integers(2)) if labelled else None,
        phase_s=rng.uniform(0, 5, len(PHASES)).astype(np.float32),
        predicted_success=float(rng.random()) if number % 2 else float("nan"),
        started_ns=1_700_000_000_000_000_000 + int(rng.integers(10**15)),
        elapsed_ns=int(rng.integers(10**10)),
    )


def make_snapshot(header: SessionHeader, rng: np.random.Generator) -> RgbdFrame:
    intrinsics = header.station.camera.intrinsics
    frame = (intrinsics.height, intrinsics.width)
    return RgbdFrame(
        rgb=rng.integers(0, 256, (*frame, 3), dtype=np.uint8),
        depth=rng.integers(0, 2**16, frame, dtype=np.uint16),
        pose_base_tool=make_pose(rng),
    )


def make_pose(rng: np.random.Generator) -> np.ndarray[Any, np.dtype[np.float64]]:
    rotation, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    pose = np.eye(4)
    pose[:3, :3] = rotation * np.sign(np.linalg.det(rotation))
    pose[:3, 3] = rng.normal(size=3)
    return pose


def make_scene(header: SessionHeader, rng: np.random.Generator) -> SceneObjects:
    count = int(rng.integers(1, header.objects_per_scene + 1))
    return SceneObjects(
        catalogue_index=rng.integers(0, len(header.station.objects), count).astype(np.int16),
        pose_base_object=rng.normal(size=(count, 7)),
        target=int(rng.integers(count)),
        conditions=rng.normal(size=len(header.station.conditions)),
    )


def record(
    repository: GraspRepository, header: SessionHeader, attempts: Iterable[GraspAttempt], *, every: int = 4
) -> SessionWriter:
    """Record a session in commits of ``every`` attempts and seal it."""
    writer = SessionWriter.begin(repository, header)
    for attempt in attempts:
        writer.append(attempt)
        if writer.next_number % every == 0:
            writer.commit()
    writer.seal()
    return writer


def difference(left: Any, right: Any, path: str = "attempt") -> str | None:
    """Where two records differ in value or type, NaN equal to NaN; None where they do not."""
    if type(left) is not type(right):
        return f"{path}: {type(left).__name__} against {type(right).__name__}"
    if is_dataclass(left):
        for field in fields(left):
            found = difference(getattr(left, field.name), getattr(right, field.name), f"{path}.{field.name}")
            if found:
                return found
        return None
    if isinstance(left, np.ndarray):
        same = left.dtype == right.dtype and left.shape == right.shape and left.tobytes() == right.tobytes()
    else:
        same = left == right or (left != left and right != right)
    return None if same else f"{path}: {left!r} against {right!r}"


def main(path: str, seed: int, attempts: int, every: int) -> None:
    header = make_header(seed=seed)
    sys.stdin.readline()
    writer = SessionWriter.begin(GraspRepository.open(path), header)
    for number in range(attempts):
        writer.append(make_attempt(header, number))
        print("appended", number, flush=True)
        if (number + 1) % every == 0:
            writer.commit()
            print("committed", number + 1, flush=True)


if __name__ == "__main__":
    main(sys.argv[1], *(int(argument) for argument in sys.argv[2:]))
