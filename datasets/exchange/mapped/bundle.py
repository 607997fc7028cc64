"""A foreign set and its map as one session of attempts."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from ulid import ULID

from handsight.datasets.errors import InterchangeError, RecordError
from handsight.datasets.exchange import hdf5, lerobot
from handsight.datasets.exchange.bundle import Bundle
from handsight.datasets.exchange.mapped import hdf5_set, lerobot_set
from handsight.datasets.exchange.mapped.episodes import EpisodeSet, as_depth, as_rgb, frame_number
from handsight.datasets.exchange.mapped.map_file import GraspMap, read_map
from handsight.datasets.exchange.mapped.poses import CONVENTIONS, pose_of, tilt_rad
from handsight.datasets.exchange.sources import checked_source
from handsight.datasets.exchange.spool import AttemptSpool
from handsight.datasets.format.sessions import new_session_attributes, sealed_attributes
from handsight.datasets.format.validation import header_faults
from handsight.datasets.records import (
    PHASES,
    GraspAttempt,
    GripperReadings,
    Outcome,
    RgbdFrame,
    SessionHeader,
    StationSpec,
)
from handsight.datasets.writing.batches import prepare
from handsight.servoing.camera import HandCamera, Intrinsics
from handsight.servoing.errors import CameraModelError
from handsight.servoing.planar import PlanarPose

_DEPTH_SCALE_M = 1e-3
_FAULTS_SHOWN = 20
_NAN = float("nan")


@contextmanager
def open_mapped(path: Path, map_path: Path) -> Iterator[Bundle]:
    """Open a set for import, as one session. Reads all that is imported, once, so that every fault shows at once.

    Raises:
        InterchangeError: The map or the set is malformed, or they do not fit; the message lists every fault.
    """
    grasps = read_map(map_path)
    if not path.exists():
        raise InterchangeError(f"there is nothing at {path} to import: check the path")
    if hdf5.recognises(path):
        opened: Any = hdf5_set.open_set(path)
    elif lerobot.recognises(path):
        opened = lerobot_set.open_set(path)
    else:
        raise InterchangeError(f"{path} is neither a LeRobotDataset nor HDF5, and a map describes one of them")
    with opened as episodes:
        depth = [] if grasps.depth is None else [grasps.depth]
        faults = episodes.faults(numbers=[grasps.label_column, grasps.pose_column], pictures=[grasps.rgb, *depth])
        unit_m = None if grasps.depth is None else episodes.depth_unit_m(grasps.depth)
        if unit_m is not None and unit_m != grasps.depth_unit_m:
            faults.append(f"{grasps.depth} says that its unit is {unit_m} m, and the map {grasps.depth_unit_m} m")
        if faults:
            raise InterchangeError(f"{map_path} does not fit {path}: {'; '.join(faults)}")
        with _read(path, map_path, grasps, episodes) as bundle:
            yield bundle


@contextmanager
def _read(path: Path, map_path: Path, grasps: GraspMap, episodes: EpisodeSet) -> Iterator[Bundle]:
    header = _header(path, grasps, episodes)
    faults = [f"{map_path}: {fault}" for fault in header_faults(header)]
    if faults:
        raise InterchangeError(f"{path} cannot be imported: {'; '.join(faults)}")
    reader = _AttemptReader(grasps, episodes, header.station)
    digests: list[bytes] = []
    kept: list[GraspAttempt] = []
    held = 0
    with AttemptSpool(header) as spool:
        for number, name in enumerate(episodes.names):
            try:
                attempt = reader.attempt(number)
                prepared = prepare(attempt, header, session="of the set", number=number)
            except (InterchangeError, RecordError) as error:
                faults.append(f"{name}: {error}")
                continue
            digests.append(prepared.columns["attempts/digest"].tobytes())
            held += attempt.success
            kept = kept or [attempt]
            if not faults:  # Else nothing will be imported.
                spool.append(prepared)
        if faults:
            more = f"; and {len(faults) - _FAULTS_SHOWN} more" if len(faults) > _FAULTS_SHOWN else ""
            raise InterchangeError(f"{path} cannot be imported: {'; '.join(faults[:_FAULTS_SHOWN])}{more}")
        size = len(episodes.names)
        source = checked_source(
            str(ULID()),
            new_session_attributes(header) | sealed_attributes(),
            size=size,
            attempts=lambda: (reader.attempt(number) for number in range(size)),
            digests=tuple(digests),
        )
        preview = {"held": held, "empty": size - held, "first": _described(episodes.names[0], kept[0])}
        yield Bundle(sessions=[replace(source, encoded=spool.attempts)], preview=preview)


def _header(path: Path, grasps: GraspMap, episodes: EpisodeSet) -> SessionHeader:
    """The station that the map describes; what had to be made up is in its configuration."""
    first = frame_number(grasps.picture_frame, len(episodes.values(0, grasps.pose_column)))
    rgb = as_rgb(episodes.picture(0, grasps.rgb, first), grasps.rgb)
    height, width, _ = rgb.shape
    fx, fy, cx, cy = grasps.focal_and_centre_px
    if not (0 <= cx < width and 0 <= cy < height):
        raise InterchangeError(f"cx, cy are {cx}, {cy}, and the pictures have {width}x{height} pixels")
    try:
        intrinsics = Intrinsics(width=width, height=height, fx=fx, fy=fy, cx=cx, cy=cy)
    except CameraModelError as error:
        raise InterchangeError(f"the camera of the map is none: {error}") from error
    x_m, y_m, z_m = _offset(grasps)
    camera = HandCamera(intrinsics=intrinsics, x_tool_camera_m=x_m, y_tool_camera_m=y_m, z_tool_camera_m=z_m)
    station = StationSpec(
        source="mapped",
        camera=camera,
        depth_scale_m=_depth_scale_m(grasps),
        gripper_stroke_m=grasps.stroke_m,
        closed_width_m=grasps.closed_width_m,
        pregrasp_height_m=grasps.pregrasp_height_m,
    )
    made_up = ["gripper.final_m"] + ["overhead.depth"] * (grasps.depth is None)
    config = {"imported_from": path.name, "format": episodes.format, "map": grasps.text, "made_up": made_up}
    return SessionHeader(station=station, seed=None, objects_per_scene=1, config=config)


def _depth_scale_m(grasps: GraspMap) -> float:
    """Of what is recorded: the set's own unit where 16 bits of it reach far enough."""
    return grasps.depth_unit_m if grasps.depth is not None and grasps.depth_unit_m <= 2e-3 else _DEPTH_SCALE_M


def _offset(grasps: GraspMap) -> NDArray[np.float64]:
    """The camera's centre in a tool frame that is turned to be parallel to the camera [m]. Shape (3,)."""
    if grasps.pose_tool_camera is None:
        return np.zeros(3)
    pose = grasps.pose_tool_camera
    offset: NDArray[np.float64] = pose[:3, :3].T @ pose[:3, 3]
    return offset


@dataclass(frozen=True, slots=True)
class _AttemptReader:
    """Makes attempts of episodes."""

    grasps: GraspMap
    episodes: EpisodeSet
    station: StationSpec

    def attempt(self, episode: int) -> GraspAttempt:
        """The attempt that an episode shows.

        Raises:
            InterchangeError: The episode is not what the map says.
        """
        poses = self._poses(episode)
        grasp = poses[frame_number(self.grasps.grasp_frame, len(poses), poses[:, 2, 3])]
        self._refuse_tilt("the tool in the grasp", grasp)
        planar = PlanarPose.from_pose_base_tool(grasp)
        held = self._held(episode)
        return GraspAttempt(
            number=episode,
            outcome=Outcome.HELD if held else Outcome.EMPTY,
            failure="",
            overhead=self._frame(episode, poses),
            pregrasp=None,
            pregrasp_x_m=planar.x_m,
            pregrasp_y_m=planar.y_m,
            pregrasp_angle_rad=planar.angle_rad,
            pose_base_tool_grasp=grasp,
            contact_force_n=0.0,
            gripper=GripperReadings(before_m=_NAN, closed_m=_NAN, lifted_m=_NAN, final_m=self._width_m(held)),
            scene=None,
            truth_held=None,
            phase_s=np.full(len(PHASES), np.nan, np.float32),
            started_ns=0,
            elapsed_ns=0,
        )

    def _width_m(self, held: bool) -> float:
        """An opening that says what the label says: half-way open, or closed."""
        closed_m = self.station.closed_width_m
        return (closed_m + self.station.gripper_stroke_m) / 2 if held else closed_m

    def _poses(self, episode: int) -> NDArray[np.float64]:
        """The tool in the base frame, with the table top at z = 0. Shape (T, 4, 4)."""
        grasps = self.grasps
        numbers = self.episodes.values(episode, grasps.pose_column)
        end = grasps.pose_first + CONVENTIONS[grasps.pose_convention]
        if numbers.ndim != 2 or numbers.dtype.kind not in "iuf" or numbers.shape[1] < end:
            raise InterchangeError(
                f"{grasps.pose_column} is {numbers.dtype} {numbers.shape}, expected frames of {end} numbers or more"
            )
        try:
            poses = np.stack(
                [
                    pose_of(
                        row[grasps.pose_first : end].astype(np.float64),
                        grasps.pose_convention,
                        unit_m=grasps.pose_unit_m,
                        z_m=grasps.grasp_z_m,
                    )
                    for row in numbers
                ]
            )
        except ValueError as error:
            raise InterchangeError(f"{grasps.pose_column}: {error}") from error
        poses = poses @ grasps.column_to_tool
        poses[:, 2, 3] -= grasps.table_z_m
        return poses

    def _held(self, episode: int) -> bool:
        """What the label says."""
        grasps = self.grasps
        column = grasps.label_column
        values = self.episodes.values(episode, column)
        values = values[:, 0] if values.ndim == 2 and values.shape[1] == 1 else values
        if values.ndim != 1 or not len(values):
            raise InterchangeError(f"the label {column} has shape {values.shape}, expected one value a frame")
        chosen = values if grasps.label_frame == "any" else values[[frame_number(grasps.label_frame, len(values))]]
        said = [
            self._says_held(value) for value in chosen.tolist()
        ]  # All of them: a fault behind a success is one too.
        return any(said)

    def _says_held(self, value: object) -> bool:
        wanted = self.grasps.label_success
        text = value.decode(errors="replace") if isinstance(value, bytes) else value
        if wanted is None:
            if not isinstance(text, bool | int | float) or math.isnan(text):
                raise InterchangeError(f"the label {self.grasps.label_column} is {text!r}, expected a number")
            return text > self.grasps.label_above
        if isinstance(wanted, str) != isinstance(text, str):
            raise InterchangeError(f"the label {self.grasps.label_column} is {text!r}, which {wanted!r} never equals")
        return text == wanted

    def _frame(self, episode: int, poses: NDArray[np.float64]) -> RgbdFrame:
        grasps = self.grasps
        number = frame_number(grasps.picture_frame, len(poses))
        rgb = as_rgb(self.episodes.picture(episode, grasps.rgb, number), grasps.rgb)
        depth = np.zeros(rgb.shape[:2], np.uint16)
        if grasps.depth is not None:
            found = self.episodes.picture(episode, grasps.depth, number)
            depth = as_depth(found, grasps.depth, grasps.depth_unit_m, self.station.depth_scale_m)
        pose = self._picture_pose(poses[number])
        self._refuse_tilt("the camera", pose)
        return RgbdFrame(rgb=rgb, depth=depth, pose_base_tool=pose)

    def _picture_pose(self, pose_base_tool: NDArray[np.float64]) -> NDArray[np.float64]:
        """The tool, turned to be parallel to the camera; of a fixed camera, the camera itself."""
        pose = np.array(pose_base_tool)
        if self.grasps.pose_tool_camera is not None:
            pose[:3, :3] = pose[:3, :3] @ self.grasps.pose_tool_camera[:3, :3]
        elif self.grasps.pose_base_camera is not None:
            pose = np.array(self.grasps.pose_base_camera)
            pose[2, 3] -= self.grasps.table_z_m
        return pose

    def _refuse_tilt(self, what: str, pose: NDArray[np.float64]) -> None:
        tilt = tilt_rad(pose)
        if tilt > self.grasps.largest_tilt_rad:
            raise InterchangeError(
                f"{what} is tilted by {math.degrees(tilt):.1f} degrees from straight down, which grasps in a plane are "
                "not; check the convention and the camera's pose, or allow it with largest_tilt_deg"
            )


def _described(name: str, attempt: GraspAttempt) -> dict[str, Any]:
    """The first attempt, as JSON values, for its owner to compare with what is known of it."""
    assert attempt.overhead is not None
    depth = attempt.overhead.depth[attempt.overhead.depth > 0]
    height, width, _ = attempt.overhead.rgb.shape
    return {
        "name": name,
        "held": attempt.success,
        "picture_px": [width, height],
        "picture_tool_xyz_m": attempt.overhead.pose_base_tool[:3, 3].round(4).tolist(),
        "grasp_x_y_m_angle_rad": [
            round(value, 4) for value in (attempt.pregrasp_x_m, attempt.pregrasp_y_m, attempt.pregrasp_angle_rad)
        ],
        "grasp_z_m": round(float(attempt.pose_base_tool_grasp[2, 3]), 4),
        "depth_units": [int(depth.min()), int(depth.max())] if len(depth) else None,
    }
