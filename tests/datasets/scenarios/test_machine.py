"""Any sequence of appends, commits, losses, releases, branches, curation and reverts, against plain dictionaries."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, field
from pathlib import Path

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule
from tests.support.factories import difference, make_attempt, make_header

from handsight.datasets import (
    Curator,
    GraspAttempt,
    GraspDataset,
    GraspRepository,
    Outcome,
    Selection,
    SessionHeader,
    SessionWriter,
    create_branch,
    delete_branch,
    diff_versions,
    revert,
    verify,
)
from handsight.datasets.format.digest import attempt_digest, dataset_digest

Attempts = dict[str, tuple[SessionHeader, GraspAttempt]]


@dataclass
class Version:
    """What a version holds, in the plainest form."""

    attempts: Attempts = field(default_factory=dict)
    decisions: list[tuple[str, int, tuple[str, ...]]] = field(default_factory=list)
    """Action, value and attempts of each."""

    def copy(self) -> Version:
        return Version(attempts=dict(self.attempts), decisions=list(self.decisions))

    def recorded(self, identity: str) -> bool | None:
        outcome = self.attempts[identity][1].outcome
        return outcome is Outcome.HELD if outcome in (Outcome.EMPTY, Outcome.HELD) else None

    def curated(self) -> dict[str, tuple[bool, bool | None]]:
        """Whether each attempt is excluded, and its label, by acting out the decisions that count."""
        counting = [True] * len(self.decisions)
        for at in reversed(range(len(self.decisions))):
            action, value, _ = self.decisions[at]
            if action == "undo" and counting[at]:
                counting[value] = False
        state = {identity: (False, self.recorded(identity)) for identity in self.attempts}
        for (action, value, ids), counts in zip(self.decisions, counting, strict=True):
            for identity in ids if counts else ():
                excluded, label = state[identity]
                state[identity] = {
                    "exclude": (True, label),
                    "restore": (False, label),
                    "relabel": (excluded, value == 1),
                    "unlabel": (excluded, self.recorded(identity)),
                }[action]
        return state


class DatasetMachine(RuleBasedStateMachine):
    def __init__(self) -> None:
        super().__init__()
        self.folder = tempfile.TemporaryDirectory()
        self.path = Path(self.folder.name) / "grasps"
        self.repository = GraspRepository.create(self.path)
        self.branches = {"main": Version()}
        self.releases: dict[str, Version] = {}
        self.pending: Attempts = {}
        self.recorded = 0

    @property
    def main(self) -> Version:
        return self.branches["main"]

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
        self.main.attempts |= self.pending
        self.recorded += len(self.pending)
        self.pending = {}

    @rule()
    def lose_the_process(self) -> None:
        """What was not committed is gone; a new process opens the folder and goes on."""
        self.pending = {}
        self.repository = GraspRepository.open(self.path)
        header = self.writer.header
        known = any(one.seed == header.seed for one, _ in self.main.attempts.values())
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
        self.releases[name] = self.main.copy()

    @precondition(lambda self: "dev" not in self.branches)
    @rule(data=st.data())
    def branch(self, data: st.DataObject) -> None:
        ref = data.draw(st.sampled_from(["main", *self.releases]))
        create_branch(self.repository, "dev", ref)
        self.branches["dev"] = self.version(ref).copy()

    @precondition(lambda self: "dev" in self.branches)
    @rule()
    def drop_the_branch(self) -> None:
        delete_branch(self.repository, "dev", force=True)
        del self.branches["dev"]

    @rule(data=st.data(), action=st.sampled_from(["exclude", "restore", "relabel", "unlabel"]), value=st.integers(0, 1))
    def curate(self, data: st.DataObject, action: str, value: int) -> None:
        name = data.draw(st.sampled_from(sorted(self.branches)))
        version = self.branches[name]
        usable = [one for one in sorted(version.attempts) if action != "relabel" or version.recorded(one) is not None]
        if not usable:
            return
        ids = tuple(data.draw(st.lists(st.sampled_from(usable), min_size=1, max_size=4, unique=True)))
        curator = Curator(self.repository, author="anna", branch=name)
        which = Selection(ids=ids)
        if action == "relabel":
            decision = curator.relabel(which, value == 1, "why")
        else:
            decision = getattr(curator, action)(which, "why")
        before = version.curated()
        version.decisions.append((action, value, ids))
        after = version.curated()
        changed = {one for one in ids if before[one] != after[one]}
        assert set(() if decision is None else decision.attempts) == changed
        version.decisions.pop()
        if decision is not None:
            version.decisions.append((action, value, decision.attempts))

    @rule(data=st.data())
    def undo(self, data: st.DataObject) -> None:
        name = data.draw(st.sampled_from(sorted(self.branches)))
        version = self.branches[name]
        undone = GraspDataset(self.repository, ref=name).overlay.undone
        counting = [number for number in range(len(version.decisions)) if number not in undone]
        if counting:
            number = data.draw(st.sampled_from(counting))
            Curator(self.repository, author="ben", branch=name).undo(number)
            version.decisions.append(("undo", number, ()))

    @rule(data=st.data())
    def revert_main(self, data: st.DataObject) -> None:
        ref = data.draw(st.sampled_from([*self.releases, *self.branches]))
        revert(self.repository, ref)
        self.branches["main"] = self.version(ref).copy()
        self.lose_the_process()

    @rule(data=st.data())
    def open_at_a_ref(self, data: st.DataObject) -> None:
        ref = data.draw(st.sampled_from([*self.branches, *self.releases]))
        version = self.version(ref)
        dataset = GraspDataset.open(f"{self.path}@{ref}")
        assert set(dataset.attempts.index) == set(version.attempts)
        assert dataset.digest == dataset_digest(
            attempt_digest(attempt, header.station) for header, attempt in version.attempts.values()
        )
        labels = dataset.attempts["success"].astype(object).where(dataset.attempts["success"].notna(), None)
        found = zip(dataset.attempts["excluded"].tolist(), labels.tolist(), strict=True)
        assert dict(zip(dataset.attempts.index, found, strict=True)) == version.curated()
        assert dataset.info().excluded == sum(excluded for excluded, _ in version.curated().values())
        if version.attempts:
            identity = data.draw(st.sampled_from(sorted(version.attempts)))
            assert difference(dataset.attempt(identity), version.attempts[identity][1]) is None
        assert verify(dataset, jobs=1).ok

    @rule(data=st.data())
    def compare(self, data: st.DataObject) -> None:
        refs = st.sampled_from([*self.branches, *self.releases])
        before, after = data.draw(refs), data.draw(refs)
        old, new = self.version(before), self.version(after)
        diff = diff_versions(GraspDataset(self.repository, ref=before), GraspDataset(self.repository, ref=after))
        was, now = old.curated(), new.curated()
        common = was.keys() & now.keys()
        assert set(diff.added) == now.keys() - was.keys()
        assert set(diff.removed) == was.keys() - now.keys()
        assert diff.replaced == ()
        assert set(diff.excluded) == {one for one in now if now[one][0] and not (one in was and was[one][0])}
        assert set(diff.restored) == {one for one in common if was[one][0] and not now[one][0]}
        assert set(diff.relabelled) == {
            one for one in now if now[one][1] != (was[one][1] if one in was else new.recorded(one))
        }
        assert diff.balance_after.successes == sum(label is True and not excluded for excluded, label in now.values())

    @invariant()
    def the_log_forgets_nothing(self) -> None:
        assert sum(entry.attempts_added for entry in self.repository.log()) == self.recorded

    def version(self, ref: str) -> Version:
        return self.releases[ref] if ref in self.releases else self.branches[ref]

    def teardown(self) -> None:
        self.folder.cleanup()


TestDataset = DatasetMachine.TestCase
TestDataset.settings = settings(
    max_examples=12, stateful_step_count=20, suppress_health_check=[HealthCheck.too_slow], deadline=None
)
