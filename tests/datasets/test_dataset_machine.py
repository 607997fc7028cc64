"""Any sequence of appends, commits, losses and releases, against a model that is a list."""

from __future__ import annotations

import tempfile
from pathlib import Path

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule
from tests.datasets.factories import difference, make_attempt, make_header

from handsight.datasets import GraspAttempt, GraspDataset, GraspRepository, SessionHeader, SessionWriter
from handsight.datasets.digest import attempt_digest, dataset_digest

Version = dict[str, tuple[SessionHeader, GraspAttempt]]


class DatasetMachine(RuleBasedStateMachine):
    def __init__(self) -> None:
        super().__init__()
        self.folder = tempfile.TemporaryDirectory()
        self.path = Path(self.folder.name) / "grasps"
        self.repository = GraspRepository.create(self.path)
        self.main: Version = {}
        self.pending: Version = {}
        self.releases: dict[str, Version] = {}

    @initialize()
    def begin(self) -> None:
        self.seeds = 0
        self.writer = SessionWriter.begin(self.repository, make_header(seed=0))

    @rule(count=st.integers(1, 4))
    def append(self, count: int) -> None:
        for _ in range(count):
            attempt = make_attempt(self.writer.header, self.writer.next_number)
            self.pending[self.writer.append(attempt)] = (self.writer.header, attempt)

    @rule(seal=st.booleans())
    def commit(self, seal: bool) -> None:
        identity = self.writer.seal() if seal else self.writer.commit()
        assert (identity is None) == (not self.pending and not (seal and self.writer.next_number))
        self.main |= self.pending
        self.pending = {}

    @rule()
    def lose_the_process(self) -> None:
        """What was not committed is gone; a new process opens the folder and goes on."""
        self.pending = {}
        self.repository = GraspRepository.open(self.path)
        header = self.writer.header
        known = any(identity.startswith(self.writer.session) for identity in self.main)
        start = SessionWriter.resume if known else SessionWriter.begin
        self.writer = start(self.repository, header)

    @rule()
    def next_session(self) -> None:
        self.pending = {}
        self.seeds += 1
        self.writer = SessionWriter.begin(self.repository, make_header(seed=self.seeds))

    @precondition(lambda self: len(self.releases) < 3)
    @rule()
    def release(self) -> None:
        name = f"v{len(self.releases)}"
        self.repository.release(name)
        self.releases[name] = dict(self.main)

    @rule(data=st.data())
    def open_at_a_ref(self, data: st.DataObject) -> None:
        ref = data.draw(st.sampled_from(["main", *self.releases]))
        version = self.releases.get(ref, self.main)
        dataset = GraspDataset.open(f"{self.path}@{ref}")
        assert set(dataset.attempts.index) == set(version)
        assert dataset.digest == dataset_digest(
            attempt_digest(attempt, header.station) for header, attempt in version.values()
        )
        if version:
            identity = data.draw(st.sampled_from(sorted(version)))
            assert difference(dataset.attempt(identity), version[identity][1]) is None

    @invariant()
    def the_log_adds_up(self) -> None:
        assert sum(entry.attempts_added for entry in self.repository.log()) == len(self.main)

    def teardown(self) -> None:
        self.folder.cleanup()


TestDataset = DatasetMachine.TestCase
TestDataset.settings = settings(
    max_examples=10, stateful_step_count=15, suppress_health_check=[HealthCheck.too_slow], deadline=None
)
