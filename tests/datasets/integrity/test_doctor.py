"""Every check finds what it is for, names the attempts, and is silent on a sound dataset."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import zarr
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from tests.support.factories import make_attempt, make_header, record
from tests.support.versions import opened

from handsight.datasets import (
    Curator,
    Diagnosis,
    GraspAttempt,
    GraspRepository,
    GripperReadings,
    Outcome,
    RgbdFrame,
    SceneObjects,
    Selection,
    SessionHeader,
    SessionWriter,
    doctor,
    make_folds,
)
from handsight.datasets.format import schema
from handsight.datasets.format.arrays import array_at
from handsight.datasets.integrity import doctor as package
from handsight.datasets.integrity.doctor.near_duplicates import NEAR_BITS, near_pairs, picture_hash
from handsight.servoing.camera import HandCamera, Intrinsics
from handsight.servoing.planar import PlanarPose

CAMERA = HandCamera(
    intrinsics=Intrinsics.from_vertical_fov(width=64, height=48, fov_y_rad=0.73),
    x_tool_camera_m=0.0,
    y_tool_camera_m=-0.07,
    z_tool_camera_m=-0.1,
)
HEADER = make_header(camera=CAMERA)
SIZE = 6


def sound_snapshot(seed: int) -> RgbdFrame:
    """Some scene on a table, seen from 0.6 m above it, straight down."""
    rng = np.random.default_rng(seed)
    pose = np.diag([1.0, -1.0, -1.0, 1.0])
    pose[:3, 3] = (0.6, 0.0, 0.5)
    rgb = np.kron(rng.integers(0, 256, (12, 16, 3)), np.ones((4, 4, 1))).astype(np.uint8)
    depth = rng.integers(560, 601, (48, 64)).astype(np.uint16)
    return RgbdFrame(rgb=rgb, depth=depth, pose_base_tool=pose)


def sound_attempt(header: SessionHeader, number: int) -> GraspAttempt:
    held = number % 2 == 0
    attempt = make_attempt(header, number, outcome=Outcome.HELD if held else Outcome.EMPTY)
    goal = PlanarPose(x_m=0.6 + 0.01 * number, y_m=0.07, angle_rad=0.1 * number)
    return replace(
        attempt,
        overhead=sound_snapshot(2 * number),
        pregrasp=sound_snapshot(2 * number + 1),
        pregrasp_x_m=goal.x_m,
        pregrasp_y_m=goal.y_m,
        pregrasp_angle_rad=goal.angle_rad,
        pose_base_tool_grasp=goal.pose_base_tool(0.02),
        scene=sound_scene(attempt.scene),
        truth_held=held,
    )


def sound_scene(scene: SceneObjects | None) -> SceneObjects | None:
    """The same objects, upright on the table."""
    if scene is None:
        return None
    poses = np.tile([0.6, 0.0, 0.03, 0.0, 0.0, 0.0, 1.0], (len(scene.catalogue_index), 1))
    return replace(scene, pose_base_object=poses)


def attempts(**changes: Any) -> list[GraspAttempt]:
    """Sound attempts; those named by ``at`` have the changes."""
    at = changes.pop("at", 2)
    return [
        replace(one, **changes) if one.number == at else one
        for one in (sound_attempt(HEADER, number) for number in range(SIZE))
    ]


def codes(diagnosis: Diagnosis) -> list[str]:
    return [finding.code for finding in diagnosis.findings]


def tamper(repository: GraspRepository, change: Callable[[zarr.Group, str], None]) -> None:
    """Write past all checks, as somebody with a Zarr library could."""
    ulid = opened(repository).sessions[0].ulid
    transaction = repository.writable("main")
    root = zarr.open_group(transaction.store, mode="r+")
    change(root, f"sessions/{ulid}")
    repository.commit(transaction, branch="main", message="tamper")


def test_a_sound_dataset_has_nothing_to_mend(repository: GraspRepository) -> None:
    record(repository, HEADER, attempts())
    make_folds(repository, "cv", by="object", count=2, seed=0, author="anna")
    seen = []
    diagnosis = doctor(opened(repository), deep=True, resimulate=sound_attempt, on_picture=lambda: seen.append(1))
    assert codes(diagnosis) == ["GD-504"]
    assert len(diagnosis.findings[0].attempts) == SIZE
    assert diagnosis.ok
    assert len(seen) == 2 * SIZE


def test_an_empty_dataset_has_no_findings(repository: GraspRepository) -> None:
    assert doctor(opened(repository), deep=True, resimulate=sound_attempt).findings == ()


def black(frame: RgbdFrame) -> RgbdFrame:
    return replace(frame, rgb=np.full_like(frame.rgb, 3))


def holed(frame: RgbdFrame) -> RgbdFrame:
    depth = frame.depth.copy()
    depth[:, :40] = 0
    return replace(frame, depth=depth)


def in_wrong_units(frame: RgbdFrame) -> RgbdFrame:
    return replace(frame, depth=(frame.depth // 10).astype(np.uint16))


def noisy(frame: RgbdFrame) -> RgbdFrame:
    noise = np.random.default_rng(0).integers(-1, 2, frame.rgb.shape)
    return replace(frame, rgb=np.clip(frame.rgb.astype(int) + noise, 0, 255).astype(np.uint8))


def closed_at(x_m: float, y_m: float, z_m: float, *, angle_rad: float = 0.0) -> dict[str, Any]:
    """A grasp commanded there and performed."""
    goal = PlanarPose(x_m=x_m, y_m=y_m, angle_rad=angle_rad)
    commanded = {"pregrasp_x_m": x_m, "pregrasp_y_m": y_m, "pregrasp_angle_rad": angle_rad}
    return {**commanded, "pose_base_tool_grasp": goal.pose_base_tool(z_m)}


def tilted(degrees: float) -> dict[str, Any]:
    """A tool that points that far from straight down, at the grasp of the third attempt."""
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("x", 180 - degrees, degrees=True).as_matrix()
    pose[:3, 3] = (0.62, 0.07, 0.02)
    return {"pose_base_tool_grasp": pose}


def in_the_air() -> RgbdFrame:
    """A picture that the camera took from under the table."""
    frame = sound_snapshot(4)
    pose = frame.pose_base_tool.copy()
    pose[2, 3] = -0.6
    return replace(frame, pose_base_tool=pose)


def far_away() -> RgbdFrame:
    """A picture from 13 m above the table."""
    frame = sound_snapshot(4)
    pose = frame.pose_base_tool.copy()
    pose[2, 3] = 12.9
    return replace(frame, pose_base_tool=pose, depth=np.full_like(frame.depth, 13_000))


def lone_object(*pose: float) -> SceneObjects:
    return SceneObjects(
        catalogue_index=np.array([0], np.int16),
        pose_base_object=np.array([pose], np.float64),
        target=0,
        conditions=np.zeros(2),
    )


FOUND_IN_ATTEMPTS: dict[str, tuple[str, list[GraspAttempt], list[int]]] = {
    "outside the picture": ("GD-203", attempts(**closed_at(1.0, 0.07, 0.02)), [2]),
    "degrees": ("GD-204", attempts(pregrasp_angle_rad=90.0), [2]),
    "truth": ("GD-207", attempts(truth_held=False), [2]),
    "black": ("GD-301", attempts(overhead=black(sound_snapshot(4))), [2]),
    "frozen": ("GD-302", attempts(overhead=sound_snapshot(2)), [2]),
    "holes": ("GD-303", attempts(pregrasp=holed(sound_snapshot(5))), [2]),
    "units": ("GD-304", attempts(overhead=in_wrong_units(sound_snapshot(4))), [2]),
    "twice": ("GD-306", attempts(at=4, overhead=sound_snapshot(0)), [0, 4]),
    "alike": ("GD-307", attempts(at=4, overhead=noisy(sound_snapshot(0))), [0, 4]),
}


IMPLAUSIBLE: dict[str, tuple[str, set[str], str, list[GraspAttempt]]] = {
    "millimetres": (
        "GD-208",
        {"GD-203", "GD-210"},
        "distance from the base is 623.9391 m, expected 0 to 1.6 m: millimetres?",
        attempts(**closed_at(620.0, 70.0, 0.02)),
    ),
    "beyond the arm": ("GD-208", {"GD-203", "GD-210"}, "2.001", attempts(**closed_at(2.0, 0.07, 0.02))),
    "height in millimetres": (
        "GD-209",
        {"GD-208"},
        "height of the grasp is 30.0 m",
        attempts(**closed_at(0.62, 0.07, 30.0)),
    ),
    "under the table": ("GD-209", set(), "-0.03 m, expected -0.02 to 5 m", attempts(**closed_at(0.62, 0.07, -0.03))),
    "above the camera": ("GD-209", set(), "closed above the camera", attempts(**closed_at(0.62, 0.07, 0.61))),
    "camera under the table": ("GD-209", {"GD-203", "GD-210", "GD-304"}, "-0.5 m", attempts(overhead=in_the_air())),
    "far outside the picture": (
        "GD-210",
        {"GD-203"},
        "pictures, expected 0 to 1",
        attempts(**closed_at(-0.7, 0.07, 0.02)),
    ),
    "force": ("GD-212", set(), "contact_force_n is 9000.0 N, expected -100 to 2000 N", attempts(contact_force_n=9e3)),
    "phase in milliseconds": (
        "GD-212",
        set(),
        "descend_s is 3500.0 s, expected 0 to 600 s: milliseconds?",
        attempts(phase_s=np.array([1, 1, 1, 3500, 1, 1, 1], np.float32)),
    ),
    "clock in seconds": ("GD-212", set(), "ns: seconds?", attempts(started_ns=1_700_000_000)),
    "total in milliseconds": ("GD-212", set(), "elapsed_ns is 45000", attempts(elapsed_ns=45_000)),
    "object far away": ("GD-212", set(), "distance of an object", attempts(scene=lone_object(600, 0, 0, 0, 0, 0, 1))),
    "a camera far away": (
        "GD-212",
        {"GD-208", "GD-209"},
        "most of a picture: depth is 13.0 m, expected 0.1 to 10 m",
        attempts(overhead=far_away()),
    ),
    "no rotation": ("GD-212", set(), "quaternion is 2.0", attempts(scene=lone_object(0.6, 0, 0, 0, 0, 0, 2))),
    "closed elsewhere": (
        "GD-213",
        set(),
        "is 0.1 m, expected 0 to 0.05 m",
        attempts(pose_base_tool_grasp=PlanarPose(x_m=0.72, y_m=0.07, angle_rad=0).pose_base_tool(0.02)),
    ),
    "tilted": ("GD-213", set(), "with a tilted tool", attempts(**tilted(45))),
}
"""By name: a code, codes that come with it, words of the message, and attempts of which the third is meant."""


@pytest.mark.parametrize("case", IMPLAUSIBLE)
def test_what_no_arm_over_a_table_does_is_found(repository: GraspRepository, case: str) -> None:
    code, others, message, recorded = IMPLAUSIBLE[case]
    record(repository, HEADER, recorded)
    dataset = opened(repository)
    findings = doctor(dataset, deep=True).findings
    assert {finding.code for finding in findings} == {code, *others}
    meant = [finding for finding in findings if finding.code == code]
    assert all(finding.attempts == (dataset.attempts.index[2],) for finding in meant)
    assert any(message in finding.message for finding in meant), [finding.message for finding in meant]


def test_an_attempt_that_could_not_be_reached_is_no_error(repository: GraspRepository) -> None:
    """What was commanded may be anywhere; what was reached may not."""
    failed = {"outcome": Outcome.UNREACHABLE, "failure": "reach: too far", "pregrasp": None, "truth_held": None}
    grasp = {"pose_base_tool_grasp": np.full((4, 4), np.nan)}
    record(repository, HEADER, attempts(pregrasp_x_m=2.0, **failed, **grasp))
    assert doctor(opened(repository), deep=True).ok


@pytest.mark.parametrize(
    ("station", "code", "message"),
    [
        ({"gripper_stroke_m": 0.8, "closed_width_m": 0.0015}, "GD-212", "gripper_stroke_m is 0.8 m, expected 0.01 to"),
        ({"depth_scale_m": 0.01}, "GD-212", "depth_scale_m is 0.01 m per unit"),
        ({"pregrasp_height_m": 3.0}, "GD-212", "pregrasp_height_m is 3.0 m"),
        ({"camera": replace(CAMERA, z_tool_camera_m=-1.0)}, "GD-212", "z_tool_camera_m is -1.0 m, expected -0.5 to"),
    ],
)
def test_an_unlikely_station_is_a_warning(
    repository: GraspRepository, station: dict[str, Any], code: str, message: str
) -> None:
    header = make_header(**{"camera": CAMERA, **station})
    widths = GripperReadings(before_m=0.085, closed_m=0.03, lifted_m=0.03, final_m=0.03)
    record(repository, header, [replace(sound_attempt(header, 0), gripper=widths)])
    found = {finding.code: finding for finding in doctor(opened(repository)).findings}
    assert set(found) == {code}
    assert (found[code].severity, message in found[code].message) == ("warning", True)


@pytest.mark.parametrize("case", FOUND_IN_ATTEMPTS)
def test_what_is_wrong_with_an_attempt_is_found(repository: GraspRepository, case: str) -> None:
    code, recorded, numbers = FOUND_IN_ATTEMPTS[case]
    record(repository, HEADER, recorded)
    dataset = opened(repository)
    diagnosis = doctor(dataset, deep=True)
    found = {finding.code: finding for finding in diagnosis.findings}
    assert found[code].attempts == tuple(dataset.attempts.index[numbers])
    assert f"{len(numbers)} " in found[code].message
    assert set(found) - {code} <= {"GD-307"}  # The same picture also looks the same.
    assert diagnosis.ok == (found[code].severity == "note")
    ids = tuple(identity for finding in diagnosis.findings for identity in finding.attempts)
    Curator(repository, author="anna").exclude(Selection(ids=ids), "the doctor said so")
    assert doctor(opened(repository), deep=True).findings == ()


def set_value(path: str, value: float) -> Callable[[zarr.Group, str], None]:
    def change(root: zarr.Group, session: str) -> None:
        array = array_at(root, f"{session}/{path}")
        rows = np.asarray(array[2:3])
        rows[..., -1] = value
        array[2:3] = rows

    return change


def shorten(root: zarr.Group, session: str) -> None:
    array = array_at(root, f"{session}/pregrasp/depth")
    array.resize((SIZE - 1, *array.shape[1:]))


def renumber(root: zarr.Group, session: str) -> None:
    array_at(root, f"{session}/attempts/number")[2] = 1


def flip_label(root: zarr.Group, session: str) -> None:
    array_at(root, f"{session}/attempts/outcome")[2] = int(Outcome.EMPTY)


def redate_to(moment: str) -> Callable[[zarr.Group, str], None]:
    def change(root: zarr.Group, session: str) -> None:
        root[session].attrs["started"] = moment

    return change


def in_millimetres(root: zarr.Group, session: str) -> None:
    """What was imported before units were looked at."""
    header: Any = root[session].attrs.asdict()["header"]
    header["station"] |= {"gripper_stroke_m": 85, "closed_width_m": 2}
    root[session].attrs["header"] = header


FOUND_AFTER_TAMPERING: dict[str, tuple[Callable[[zarr.Group, str], None], bool]] = {
    "GD-103": (shorten, False),
    "GD-106": (renumber, False),
    "GD-107": (redate_to("2001-01-01T00:00:00+00:00"), False),
    "GD-201": (set_value("attempts/pregrasp_x_y_angle", math.nan), False),
    "GD-202": (set_value("attempts/gripper_width_m", 0.85), False),
    "GD-205": (set_value("attempts/phase_s", -1.0), False),
    "GD-206": (flip_label, False),
    "GD-211": (set_value("attempts/contact_force_n", 1e9), False),
    "GD-212": (redate_to("1970-01-01T00:00:07+00:00"), False),
}


@pytest.mark.parametrize("code", FOUND_AFTER_TAMPERING)
def test_what_no_writer_would_have_stored_is_found(repository: GraspRepository, code: str) -> None:
    change, ok = FOUND_AFTER_TAMPERING[code]
    record(repository, HEADER, attempts())
    tamper(repository, change)
    diagnosis = doctor(opened(repository))
    assert code in codes(diagnosis)
    assert diagnosis.ok is ok


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (in_millimetres, "gripper_stroke_m is 85 m, expected 0.001 to 1 m: millimetres?"),
        (redate_to("noon"), "started is 'noon', expected a time in ISO 8601"),
    ],
)
def test_what_older_versions_took_is_an_error(
    repository: GraspRepository, change: Callable[[zarr.Group, str], None], message: str
) -> None:
    record(repository, HEADER, attempts())
    tamper(repository, change)
    found = [finding.message for finding in doctor(opened(repository)).findings if finding.code == "GD-211"]
    assert any(message in one for one in found), found


def test_damaged_pictures_are_a_finding_not_a_crash(repository: GraspRepository) -> None:
    record(repository, HEADER, attempts())
    largest = max((repository.folder / "chunks").iterdir(), key=lambda path: path.stat().st_size)
    largest.write_bytes(bytes(largest.stat().st_size))
    assert doctor(opened(repository)).ok
    diagnosis = doctor(opened(repository), deep=True)
    assert codes(diagnosis) == ["GD-106"]
    assert "handsight dataset verify" in diagnosis.findings[0].message


def test_an_open_session_is_noted(repository: GraspRepository) -> None:
    with SessionWriter.begin(repository, HEADER) as writer:
        for attempt in attempts():
            writer.append(attempt)
    diagnosis = doctor(opened(repository))
    assert codes(diagnosis) == ["GD-101"]
    assert writer.session in diagnosis.findings[0].message
    assert diagnosis.ok


def test_intrinsics_of_another_mode_are_found(repository: GraspRepository) -> None:
    lens = replace(CAMERA.intrinsics, cx=12.0)
    header = make_header(camera=replace(CAMERA, intrinsics=lens))
    record(repository, header, attempts())
    assert "GD-305" in codes(doctor(opened(repository)))


def test_clocks_of_a_rig_that_run_backwards_are_found(repository: GraspRepository) -> None:
    rig = make_header(seed=None, source="ur10", camera=CAMERA)
    second, noon_ns = 10**9, 1_700_000_000_000_000_000
    timed = [
        replace(one, started_ns=(100 - one.number if one.number == 3 else 100 + 60 * one.number) * second + noon_ns)
        for one in attempts()
    ]
    timed = [replace(one, elapsed_ns=40 * second) for one in timed]
    record(repository, rig, timed)
    dataset = opened(repository)
    (finding,) = doctor(dataset).findings
    assert (finding.code, finding.attempts) == ("GD-205", (dataset.attempts.index[3],))


def test_a_rare_label_is_found(repository: GraspRepository) -> None:
    empty = sound_attempt(HEADER, 1)
    record(repository, HEADER, [replace(empty, number=number) for number in range(60)], every=60)
    diagnosis = doctor(opened(repository))
    assert codes(diagnosis) == ["GD-401"]
    assert "0.0% of 60 labelled attempts succeed" in diagnosis.findings[0].message


def test_folds_that_no_longer_fit_and_pictures_in_two_folds_are_found(repository: GraspRepository) -> None:
    """The same scene was recorded again in another session, and the folds part sessions."""
    for seed in (1, 2):
        header = replace(HEADER, seed=seed)
        record(repository, header, [sound_attempt(HEADER, number) for number in range(SIZE)])
    make_folds(repository, "cv", by="session", count=2, seed=0, author="anna")
    diagnosis = doctor(opened(repository), deep=True)
    assert codes(diagnosis) == ["GD-306", "GD-307", "GD-403"]
    assert len(diagnosis.findings[-1].attempts) == 2 * SIZE
    Curator(repository, author="anna").exclude(Selection(where="number == 0"), "x")
    stale = doctor(opened(repository))
    assert codes(stale) == ["GD-402"]
    assert "folds 'cv': they hold 2 attempts excluded" in stale.findings[0].message


def test_attempts_that_end_otherwise_when_repeated_are_named(repository: GraspRepository) -> None:
    record(repository, HEADER, attempts())
    asked = []

    def again(header: SessionHeader, number: int) -> GraspAttempt | None:
        asked.append(number)
        attempt = sound_attempt(header, 0 if number == 1 else number)
        if number == 2:
            return replace(attempt, contact_force_n=attempt.contact_force_n + 1)
        return None if number == 5 else attempt

    dataset = opened(repository)
    diagnosis = doctor(dataset, resimulate=again, resimulated=SIZE)
    assert sorted(asked) == list(range(SIZE))
    ids = dataset.attempts.index
    found = [(one.code, one.attempts) for one in diagnosis.findings]
    alike = tuple(ids[number] for number in range(SIZE) if number not in (1, 2, 5))
    assert found == [("GD-501", (ids[1],)), ("GD-502", (ids[2],)), ("GD-503", (ids[5],)), ("GD-504", alike)]
    asked.clear()
    doctor(dataset, resimulate=again, resimulated=2, seed=4)
    first = list(asked)
    asked.clear()
    doctor(dataset, resimulate=again, resimulated=2, seed=4)
    assert asked == first
    assert len(first) == 2


def test_every_code_is_in_the_list_and_has_one_severity() -> None:
    listed = dict(re.findall(r"^(GD-\d+)\s+(\w+)", package.__doc__ or "", re.MULTILINE))
    tested = {*FOUND_AFTER_TAMPERING, *(code for code, _, _ in FOUND_IN_ATTEMPTS.values())}
    tested |= {code for code, _, _, _ in IMPLAUSIBLE.values()}
    tested |= {
        "GD-101",
        "GD-105",
        "GD-106",
        "GD-305",
        "GD-401",
        "GD-402",
        "GD-403",
        "GD-501",
        "GD-502",
        "GD-503",
        "GD-504",
    }
    assert set(listed) == tested
    assert set(listed.values()) == {"error", "warning", "note"}


def test_decisions_about_attempts_that_are_gone_are_found(repository: GraspRepository) -> None:
    record(repository, HEADER, attempts())
    Curator(repository, author="anna").exclude(Selection(where="number == 2"), "x")
    dataset = opened(repository)
    gone = dataset.sessions[0].ulid

    def change(root: zarr.Group, session: str) -> None:
        del root[session]

    tamper(repository, change)
    diagnosis = doctor(opened(repository))
    assert codes(diagnosis) == ["GD-105"]
    assert diagnosis.findings[0].attempts == (schema.attempt_id(gone, 2),)


@given(
    seeds=st.lists(st.integers(0, 2**256 - 1), min_size=1, max_size=12),
    flips=st.lists(st.tuples(st.integers(0, 11), st.sets(st.integers(0, 255), max_size=12)), max_size=12),
)
def test_near_pairs_are_those_that_comparing_all_finds(seeds: list[int], flips: list[tuple[int, set[int]]]) -> None:
    values = [*seeds]
    for source, bits in flips:
        values.append(seeds[source % len(seeds)] ^ sum(1 << bit for bit in bits))
    hashes = {f"a{at}": value for at, value in enumerate(values)}
    pairs = list(near_pairs(hashes))
    assert len({frozenset(pair) for pair in pairs}) == len(pairs)
    assert all((hashes[left] ^ hashes[right]).bit_count() <= NEAR_BITS for left, right in pairs)
    distinct = sorted(set(hashes.values()))
    expected = {(a, b) for at, a in enumerate(distinct) for b in distinct[at + 1 :] if (a ^ b).bit_count() <= NEAR_BITS}
    found = {tuple(sorted((hashes[left], hashes[right]))) for left, right in pairs if hashes[left] != hashes[right]}
    assert found == expected


def test_noise_leaves_a_picture_near_itself() -> None:
    picture = sound_snapshot(0)
    distance = (picture_hash(picture.rgb) ^ picture_hash(noisy(picture).rgb)).bit_count()
    assert distance <= NEAR_BITS
    other = (picture_hash(picture.rgb) ^ picture_hash(sound_snapshot(1).rgb)).bit_count()
    assert other > 4 * NEAR_BITS
