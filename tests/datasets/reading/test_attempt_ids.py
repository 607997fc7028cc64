"""Attempts named by number, by a unique beginning, or in full."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.support.factories import make_attempt, make_header, record

from handsight.datasets import AttemptNotFoundError, GraspDataset, GraspRepository
from handsight.datasets.reading.attempt_ids import _beginning_with, resolve_attempt_ids, short_id


@pytest.fixture(scope="module")
def grasps(tmp_path_factory: pytest.TempPathFactory) -> GraspDataset:
    """Two sessions, with 11 attempts and with 3."""
    repository = GraspRepository.create(tmp_path_factory.mktemp("ids") / "grasps")
    for seed, count in ((1, 11), (2, 3)):
        header = make_header(seed=seed, width=16, height=12)
        record(repository, header, [make_attempt(header, number) for number in range(count)])
    return GraspDataset(repository, ref="main")


def fault(dataset: GraspDataset, *texts: str) -> str:
    with pytest.raises(AttemptNotFoundError) as caught:
        resolve_attempt_ids(dataset, texts)
    return str(caught.value)


def beginning(dataset: GraspDataset, session: int) -> str:
    """The shortest beginning that tells a session from the other."""
    mine, other = dataset.sessions[session].ulid, dataset.sessions[1 - session].ulid
    return next(mine[:length] for length in range(1, len(mine) + 1) if not other.startswith(mine[:length]))


def test_a_whole_id_means_itself(grasps: GraspDataset) -> None:
    ids = grasps.attempts.index.tolist()
    assert resolve_attempt_ids(grasps, ids) == ids
    assert resolve_attempt_ids(grasps, [ids[3].lower(), ids[1], ids[3]]) == [ids[3], ids[1]]
    assert resolve_attempt_ids(grasps, []) == []


def test_a_number_means_the_only_attempt_that_has_it(grasps: GraspDataset) -> None:
    first, second = (session.ulid for session in grasps.sessions)
    assert resolve_attempt_ids(grasps, ["10", "000007"]) == [f"{first}-000010", f"{first}-000007"]
    said = fault(grasps, "2")
    assert f"'2' of {grasps.repository.path}@main can be any of 2: {first}-000002, {second}-000002" in said
    assert "write out more" in said


def test_a_number_of_a_session_needs_no_more_of_it_than_tells_it_apart(grasps: GraspDataset) -> None:
    for at, session in enumerate(grasps.sessions):
        assert resolve_attempt_ids(grasps, [f"{beginning(grasps, at)}-2"]) == [f"{session.ulid}-000002"]


def test_a_beginning_means_the_only_id_that_begins_so(grasps: GraspDataset, tmp_path: Path) -> None:
    first = grasps.sessions[0].ulid
    assert resolve_attempt_ids(grasps, [f"{first}-00001"]) == [f"{first}-000010"]
    assert "can be any of 11" in fault(grasps, beginning(grasps, 0))
    assert "can be any of 10" in fault(grasps, f"{first}-00000")
    assert "can be any of 14" in fault(grasps, first[:2])
    assert f"{first}-000000, {first}-000001, {first}-000002 and 11 more" in fault(grasps, first[:2])
    repository = GraspRepository.create(tmp_path / "one")
    header = make_header(width=16, height=12)
    record(repository, header, [make_attempt(header, 0)])
    alone = GraspDataset(repository, ref="main")
    assert resolve_attempt_ids(alone, [alone.sessions[0].ulid[:4]]) == alone.attempts.index.tolist()


def test_what_means_nothing_is_refused_with_what_there_is(grasps: GraspDataset) -> None:
    first, second = (session.ulid for session in grasps.sessions)
    unknown = "01ARZ3NDEKTSV4RRFFQ69G5FAV-000000"
    for text in ("12", "nonsense", f"{first}-12", f"{second}-000003", unknown, "", "-", "-1", "-000001", "²"):
        said = fault(grasps, text)
        assert f"there is no attempt {text!r} in {grasps.repository.path}@main" in said
        assert f"{first} with 11, {second} with 3" in said
    assert re.findall("'(12|2|x)'", fault(grasps, "12", "10", "2", "x")) == ["12", "2", "x"]  # all faults at once


def test_more_digits_than_a_number_can_have_mean_nothing(grasps: GraspDataset) -> None:
    """Python refuses to read more than 4300 of them, with an error that is nobody's."""
    first, digits = grasps.sessions[0].ulid, "1" * 5000
    for text in (digits, f"{first}-{digits}", f"{first}-{'0' * 5000}"):
        assert "there is no attempt" in fault(grasps, text)
        with pytest.raises(AttemptNotFoundError):
            grasps.attempt(text)


@given(st.integers(0, 1_000_300), st.from_regex(r"[0-9]{0,8}", fullmatch=True))
def test_beginnings_of_numbers_are_counted_without_being_listed(attempts: int, digits: str) -> None:
    edges = {int(digits or 0) * 10**power for power in range(8)} | {attempts, 1_000_000}
    near = {edge + offset for edge in edges for offset in (-1, 0, 1)}
    ranges = list(_beginning_with(digits, attempts))
    for number in near:
        counted = sum(number in one for one in ranges)
        assert counted == (0 <= number < attempts and f"{number:06d}".startswith(digits))


def test_short_ids_are_taken_back(grasps: GraspDataset) -> None:
    ids = grasps.attempts.index.tolist()
    shortened = short_id(grasps)
    short = [shortened(one) for one in ids]
    assert resolve_attempt_ids(grasps, short) == ids
    assert len(set(short)) == len(ids)
    assert all(re.fullmatch(r"[0-9A-Z]{8,26}-(0|[1-9][0-9]*)", one) for one in short)
    assert max(map(len, short)) < len(ids[0])
