"""What was appended comes back, whole, by every way of reading."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.support.factories import OBJECTS, difference, make_attempt, make_header, record

from handsight.datasets import (
    VIEWPOINTS,
    AttemptNotFoundError,
    FrameNotFoundError,
    GraspDataset,
    GraspRepository,
    Outcome,
    SessionNotFoundError,
    SessionWriter,
)
from handsight.datasets.format.rows import frame_of
from handsight.datasets.format.schema import attempt_id

HEADER = make_header()


@settings(max_examples=10)
@given(
    seed=st.integers(0, 2**63 - 1),
    widths=st.integers(1, 5),
    conditions=st.sampled_from([(), ("table_friction",), ("a", "b", "c")]),
    width=st.integers(1, 40),
    height=st.integers(1, 30),
    every=st.integers(1, 5),
    scale=st.floats(1e-6, 1e-2),
)
def test_every_field_comes_back(
    seed: int, widths: int, conditions: tuple[str, ...], width: int, height: int, every: int, scale: float
) -> None:
    header = make_header(
        seed=seed, objects_per_scene=widths, conditions=conditions, width=width, height=height, depth_scale_m=scale
    )
    attempts = [make_attempt(header, number) for number in range(7)]
    with tempfile.TemporaryDirectory() as folder:
        writer = record(GraspRepository.create(Path(folder) / "grasps"), header, attempts, every=every)
        dataset = GraspDataset.open(f"{folder}/grasps")
        stored = [dataset.attempt(identity) for identity in dataset.attempts.index]
        assert [difference(left, right) for left, right in zip(attempts, stored, strict=True)] == [None] * 7
        assert dataset.station(writer.session) == header.station
        assert dataset.session(dataset.attempts.index[0]).header == header


def test_conditions_are_columns_of_the_table(repository: GraspRepository) -> None:
    """Sessions may vary different things; what a session did not vary is missing there."""
    values = {}
    for seed, names in enumerate([("table_friction",), ("light_ambient", "table_friction"), ()]):
        header = make_header(seed=seed, conditions=names)
        attempts = [make_attempt(header, number) for number in range(6)]
        session = record(repository, header, attempts).session
        for attempt in attempts:
            for name, value in zip(names, attempt.scene.conditions if attempt.scene else (), strict=False):
                values[attempt_id(session, attempt.number), name] = value
    dataset = GraspDataset.open(str(repository.path))
    table = dataset.attempts[["light_ambient", "table_friction"]]
    assert table.stack().dropna().to_dict() == values
    assert dataset.table("table_friction").equals(table[["table_friction"]])


def test_the_table_tells_what_the_attempts_tell(dataset: GraspDataset) -> None:
    table = dataset.attempts
    assert len(table) == 27
    assert table.index.is_unique
    for identity, row in table.iterrows():
        attempt = dataset.attempt(str(identity))
        assert identity == f"{row['session']}-{attempt.number:06d}"
        assert row["outcome"] == attempt.outcome.name.lower()
        assert (row["success"] is pd.NA) == (not attempt.labelled)
        if attempt.labelled:
            assert row["success"] == (attempt.outcome is Outcome.HELD)
        assert (None if row["truth_held"] is pd.NA else row["truth_held"]) == attempt.truth_held
        assert row["failure"] == attempt.failure
        names = () if attempt.scene is None else tuple(OBJECTS[index] for index in attempt.scene.catalogue_index)
        assert row["objects"] == names
        assert (row["target"] == names[attempt.scene.target]) if attempt.scene else pd.isna(row["target"])
        assert (row["overhead_taken"], row["pregrasp_taken"]) == (
            attempt.overhead is not None,
            attempt.pregrasp is not None,
        )
        pairs = [
            ("pregrasp_x_m", attempt.pregrasp_x_m),
            ("pregrasp_y_m", attempt.pregrasp_y_m),
            ("pregrasp_angle_rad", attempt.pregrasp_angle_rad),
            ("width_before_m", attempt.gripper.before_m),
            ("width_closed_m", attempt.gripper.closed_m),
            ("width_lifted_m", attempt.gripper.lifted_m),
            ("width_final_m", attempt.gripper.final_m),
            ("contact_force_n", attempt.contact_force_n),
            ("settle_s", attempt.phase_s[0]),
            ("shake_s", attempt.phase_s[6]),
        ]
        np.testing.assert_array_equal([row[name] for name, _ in pairs], [value for _, value in pairs])
        assert row["started"].value == attempt.started_ns
        assert row["elapsed_s"] == attempt.elapsed_ns / 1e9


def test_an_empty_dataset_has_the_same_columns(dataset: GraspDataset, tmp_path: Path) -> None:
    GraspRepository.create(tmp_path / "empty")
    empty = GraspDataset.open(f"{tmp_path}/empty").attempts
    recorded = dataset.attempts.drop(columns=list(dataset.sessions[0].header.station.conditions))
    pd.testing.assert_series_equal(empty.dtypes, recorded.dtypes)
    assert len(empty) == 0
    assert empty.index.dtype == dataset.attempts.index.dtype


def test_sessions_with_and_without_seed_share_a_table(dataset: GraspDataset) -> None:
    rig = make_header(seed=None, source="ur10")
    record(dataset.repository, rig, [make_attempt(rig, 0)])
    seeds = GraspDataset.open(str(dataset.repository.path)).attempts["seed"]
    assert seeds.dtype == "Int64"
    assert seeds.value_counts(dropna=False).to_dict() == {1: 24, 2: 3, pd.NA: 1}


@pytest.mark.parametrize("viewpoint", VIEWPOINTS)
def test_pictures_stream_in_the_order_asked_for(dataset: GraspDataset, viewpoint: Any) -> None:
    everything = list(dataset.frames(viewpoint))
    taken = dataset.attempts.index[dataset.attempts[f"{viewpoint}_taken"]].tolist()
    assert [identity for identity, _ in everything] == taken
    assert 0 < len(taken) < 27
    rng = np.random.default_rng(0)
    for ids in (taken[::-1], taken[3:4] * 3, list(rng.permutation(taken))):
        found = list(dataset.frames(viewpoint, ids))
        assert [identity for identity, _ in found] == ids
        for identity, frame in found:
            assert difference(frame, frame_of(dataset.attempt(identity), viewpoint)) is None
            assert difference(frame, dataset.frame(identity, viewpoint)) is None
    assert list(dataset.frames(viewpoint, [])) == []


def test_a_long_run_is_read_in_blocks(repository: GraspRepository) -> None:
    attempts = [make_attempt(HEADER, number, outcome=Outcome.HELD) for number in range(35)]
    record(repository, HEADER, attempts, every=35)
    found = [frame for _, frame in GraspDataset.open(str(repository.path)).frames("pregrasp")]
    for attempt, frame in zip(attempts, found, strict=True):
        assert difference(attempt.pregrasp, frame) is None


def test_what_is_not_there_is_named(dataset: GraspDataset) -> None:
    session = dataset.sessions[1].ulid
    beyond = [f"{session}-000003", f"{session}-3", f"{session}--00001", f"7{session[1:]}-000000", "nonsense", ""]
    for identity in beyond:
        with pytest.raises(AttemptNotFoundError):
            dataset.attempt(identity)
    with pytest.raises(SessionNotFoundError):
        dataset.station("nonsense")
    never = dataset.attempts.index[~dataset.attempts["pregrasp_taken"]]
    with pytest.raises(FrameNotFoundError, match=never[0]):
        dataset.frame(never[0], "pregrasp")
    with pytest.raises(FrameNotFoundError, match=r"and \d+ more"):
        dataset.frames("pregrasp", never)


def test_an_open_version_does_not_move(dataset: GraspDataset) -> None:
    writer = SessionWriter.resume(dataset.repository, make_header(seed=2))
    writer.append(make_attempt(writer.header, 3))
    writer.commit()
    assert len(dataset.attempts) == 27
    assert len(GraspDataset.open(f"{dataset.repository.path}@{dataset.snapshot_id}").attempts) == 27
    assert len(GraspDataset.open(str(dataset.repository.path)).attempts) == 28


def test_a_session_tells_who_recorded_it(dataset: GraspDataset) -> None:
    session = dataset.sessions[0]
    assert session.code.keys() == {"version", "commit", "dirty"}
    assert session.packages.keys() >= {"python", "numpy", "zarr", "icechunk"}
    assert len(session.config_digest) == 64
    assert session.started.endswith("+00:00")
    assert session.config_digest == dataset.sessions[1].config_digest
