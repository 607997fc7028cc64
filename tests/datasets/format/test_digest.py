"""The digest changes with everything that is content and with nothing else."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import fields, is_dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.support.factories import OBJECTS, make_attempt, make_header, make_scene, make_station, record

from handsight.datasets import (
    GraspAttempt,
    GraspDataset,
    GraspRepository,
    GripperReadings,
    Outcome,
    RgbdFrame,
    SceneObjects,
    StationSpec,
)
from handsight.datasets.format.digest import attempt_digest, dataset_digest
from handsight.servoing.camera import HandCamera, Intrinsics

HEADER = make_header()
STATION = HEADER.station
NOT_CONTENT = {"number", "started_ns", "elapsed_ns"}


def full_attempt() -> GraspAttempt:
    """One that has everything: both pictures, a scene, truth."""
    attempt = make_attempt(HEADER, 0, outcome=Outcome.HELD)
    scene = make_scene(HEADER, np.random.default_rng(3))
    return replace(attempt, scene=scene, truth_held=True, predicted_success=0.25)


def leaves(record: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Paths to every field that is no record itself."""
    if not is_dataclass(record):
        yield path
        return
    for field in fields(record):
        yield from leaves(getattr(record, field.name), (*path, field.name))


def changed(record: Any, path: tuple[str, ...], at: int) -> Any:
    """The record with one field, or one element of an array, changed as little as can be."""
    if path:
        return replace(record, **{path[0]: changed(getattr(record, path[0]), path[1:], at)})
    if isinstance(record, np.ndarray):
        copy = record.copy()
        index = np.unravel_index(at % record.size, record.shape)
        if np.issubdtype(record.dtype, np.floating):
            copy[index] = np.nextafter(copy[index], np.inf)
        else:
            copy[index] = (int(copy[index]) + 1) % len(OBJECTS)
        return copy
    if isinstance(record, Outcome):
        return Outcome((record + 1 + at % 3) % 4)
    if isinstance(record, bool):
        return not record
    if isinstance(record, float):
        return float(np.nextafter(record, np.inf))
    if isinstance(record, int):
        return record + 1
    if isinstance(record, tuple):
        return (record[0] + "x", *record[1:])
    if isinstance(record, dict):
        return {**record, "robot": "UR10-1"}
    return record + "x"


@settings(max_examples=5)
@given(at=st.integers(0, 2**31))
@pytest.mark.parametrize("path", list(leaves(full_attempt())), ids=".".join)
def test_the_digest_depends_on_every_field_but_ids_and_clocks(path: tuple[str, ...], at: int) -> None:
    attempt = full_attempt()
    before = attempt_digest(attempt, STATION)
    after = attempt_digest(changed(attempt, path, at), STATION)
    assert (after == before) == (path[-1] in NOT_CONTENT)


@pytest.mark.parametrize("path", [path for path in leaves(STATION) if path != ("objects",)], ids=".".join)
def test_the_digest_depends_on_the_instruments(path: tuple[str, ...]) -> None:
    attempt = full_attempt()
    other: StationSpec = changed(STATION, path, 0)
    assert attempt_digest(attempt, other) != attempt_digest(attempt, STATION)


@pytest.mark.parametrize("name", ["overhead", "pregrasp", "scene", "truth_held"])
def test_what_is_missing_is_not_what_is_zero(name: str) -> None:
    attempt = full_attempt()
    without: dict[str, Any] = {name: None}
    assert attempt_digest(replace(attempt, **without), STATION) != attempt_digest(attempt, STATION)
    refused = replace(attempt, truth_held=False)
    assert attempt_digest(replace(attempt, truth_held=None), STATION) != attempt_digest(refused, STATION)


def test_objects_count_by_name_not_by_index() -> None:
    attempt = full_attempt()
    assert attempt.scene is not None
    turned = make_station(objects=OBJECTS[::-1])
    indices = (len(OBJECTS) - 1 - attempt.scene.catalogue_index).astype(np.int16)
    same = replace(attempt, scene=replace(attempt.scene, catalogue_index=indices))
    assert attempt_digest(same, turned) == attempt_digest(attempt, STATION)
    assert attempt_digest(attempt, turned) != attempt_digest(attempt, STATION)


def test_room_for_more_objects_changes_nothing(tmp_path: Path) -> None:
    digests = set()
    for widths in (3, 5):
        header = replace(HEADER, objects_per_scene=widths)
        record(GraspRepository.create(tmp_path / str(widths)), header, [full_attempt()])
        digests.add(GraspDataset.open(f"{tmp_path}/{widths}").digest)
    assert len(digests) == 1


def test_every_zero_and_every_nan_counts_as_one() -> None:
    attempt = full_attempt()
    odd_nan = np.frombuffer(np.uint64(0x7FF8000000000123).tobytes(), np.float64)
    poses = [np.full((4, 4), value) for value in (np.nan, odd_nan[0])]
    assert len({attempt_digest(replace(attempt, pose_base_tool_grasp=pose), STATION) for pose in poses}) == 1
    forces = [replace(attempt, contact_force_n=force) for force in (0.0, -0.0)]
    assert len({attempt_digest(one, STATION) for one in forces}) == 1


def test_the_stored_digest_is_that_of_the_attempt_read_back(repository: GraspRepository) -> None:
    attempts = [make_attempt(HEADER, number) for number in range(12)]
    record(repository, HEADER, attempts)
    dataset = GraspDataset.open(str(repository.path))
    for identity, stored in dataset.attempts["digest"].items():
        assert attempt_digest(dataset.attempt(str(identity)), dataset.station(str(identity))).hex() == stored


@settings(max_examples=8)
@given(data=st.data())
def test_the_dataset_digest_does_not_depend_on_sessions_or_commits(
    data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    attempts = [make_attempt(HEADER, number) for number in range(6)]
    folder = tmp_path_factory.mktemp("digest")
    record(GraspRepository.create(folder / "one"), HEADER, attempts, every=6)
    shuffled = data.draw(st.permutations(attempts))
    cuts = sorted(data.draw(st.sets(st.integers(1, 5), max_size=3)))
    repository = GraspRepository.create(folder / "many")
    for seed, (start, stop) in enumerate(pairwise([0, *cuts, 6])):
        part = [replace(attempt, number=number) for number, attempt in enumerate(shuffled[start:stop])]
        record(repository, make_header(seed=seed), part, every=data.draw(st.integers(1, 3)))
    many = GraspDataset.open(str(repository.path))
    assert len(many.sessions) == len(cuts) + 1
    assert many.digest == GraspDataset.open(str(folder / "one")).digest


def test_the_dataset_digest_counts_repeated_attempts() -> None:
    one, two = b"a" * 32, b"b" * 32
    assert len({dataset_digest(case) for case in ([], [one], [one, one], [one, two])}) == 4
    assert dataset_digest([one, two]) == dataset_digest([two, one])


@given(
    st.lists(
        st.tuples(st.sampled_from((b"\0" * 8, b"\x01" + b"\0" * 7, b"\xff" * 8)), st.binary(min_size=24, max_size=24))
    )
)
def test_digests_enter_in_the_order_of_their_bytes(parts: list[tuple[bytes, bytes]]) -> None:
    digests = [head + tail for head, tail in parts]
    expected = hashlib.sha256(b"handsight dataset 1\n" + b"".join(sorted(digests))).hexdigest()
    assert dataset_digest(digests) == expected


def golden_attempt() -> GraspAttempt:
    """Written out, because random streams and linear algebra differ between versions and machines."""
    pose = np.eye(4)
    pose[:3, 3] = (0.25, -0.5, 0.125)
    rgb = np.arange(6 * 8 * 3, dtype=np.uint8).reshape(6, 8, 3)
    depth = np.arange(6 * 8, dtype=np.uint16).reshape(6, 8) * 1000
    return GraspAttempt(
        number=0,
        outcome=Outcome.HELD,
        failure="",
        overhead=RgbdFrame(rgb=rgb, depth=depth, pose_base_tool=pose),
        pregrasp=RgbdFrame(rgb=rgb[::-1], depth=depth[::-1], pose_base_tool=pose),
        pregrasp_x_m=0.25,
        pregrasp_y_m=-0.5,
        pregrasp_angle_rad=1.5,
        pose_base_tool_grasp=pose,
        contact_force_n=2.0,
        gripper=GripperReadings(before_m=0.085, closed_m=0.03, lifted_m=0.02, final_m=0.01),
        scene=SceneObjects(catalogue_index=np.array([4, 0], np.int16), pose_base_object=np.ones((2, 7)), target=1),
        truth_held=True,
        phase_s=np.arange(7, dtype=np.float32),
        started_ns=1,
        elapsed_ns=2,
    )


GOLDEN_CAMERA = HandCamera(
    intrinsics=Intrinsics(width=8, height=6, fx=8.0, fy=8.0, cx=3.5, cy=2.5),
    x_tool_camera_m=0.0,
    y_tool_camera_m=-0.07,
    z_tool_camera_m=-0.1,
)


def test_the_digest_is_the_one_existing_datasets_have(repository: GraspRepository) -> None:
    """Changing these figures changes the identity of every dataset there is."""
    header = make_header(camera=GOLDEN_CAMERA, conditions=())
    unlabelled = replace(
        golden_attempt(),
        number=1,
        outcome=Outcome.ABORTED,
        failure="look: cable",
        pregrasp=None,
        scene=None,
        truth_held=None,
    )
    record(repository, header, [golden_attempt(), unlabelled])
    dataset = GraspDataset.open(str(repository.path))
    assert [digest[:16] for digest in dataset.attempts["digest"]] == ["21b078f77f46a979", "4f356e30933d141f"]
    assert dataset.digest[:16] == "e3e2315fe180991c"


def test_a_digest_does_not_depend_on_what_was_digested_before() -> None:
    """Stations that compare equal need not be written alike: a text remembered for one is wrong for the other."""
    attempt = make_attempt(HEADER, 0)
    zeros = [replace(STATION, serials=None, closed_width_m=zero) for zero in (0.0, -0.0)]
    assert zeros[0] == zeros[1]
    forwards = [attempt_digest(attempt, station) for station in zeros]
    backwards = [attempt_digest(attempt, station) for station in reversed(zeros)]
    assert forwards == backwards[::-1]
    assert forwards[0] != forwards[1]
