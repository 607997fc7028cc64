"""What changed between two versions, in attempts."""

from __future__ import annotations

from tests.support.factories import make_attempt
from tests.support.versions import HEADER, grow, numbers, opened

from handsight.datasets import Curator, GraspRepository, Outcome, Selection, SessionWriter, create_branch, diff_versions


def test_diff_names_what_was_added_removed_and_replaced(repository: GraspRepository) -> None:
    grow(repository, 3)
    create_branch(repository, "dev")
    grow(repository, 5)
    with SessionWriter.resume(repository, HEADER, "dev") as writer:
        writer.append(make_attempt(HEADER, 3, outcome=Outcome.UNREACHABLE))
    diff = diff_versions(opened(repository, "dev"), opened(repository))
    assert (numbers(diff.added), numbers(diff.removed), numbers(diff.replaced)) == ([4], [], [3])
    back = diff_versions(opened(repository), opened(repository, "dev"))
    assert (numbers(back.added), numbers(back.removed), numbers(back.replaced)) == ([], [4], [3])
    assert (back.before, back.after) == (diff.after, diff.before)


def test_diff_names_what_curation_did_and_how_the_balance_moved(repository: GraspRepository) -> None:
    anna = Curator(repository, author="anna")
    grow(repository, 6)
    anna.exclude(Selection(where="number == 5"), "x")
    before = opened(repository)
    anna.restore(Selection(where="number == 5"), "y")
    anna.exclude(Selection(where="number in [0, 1]"), "z")
    anna.relabel(Selection(where="number == 2"), False, "z")
    grow(repository, 8)
    anna.relabel(Selection(where="number == 7"), True, "z")
    anna.exclude(Selection(where="number == 6"), "z")
    after = opened(repository)
    diff = diff_versions(before, after)
    assert numbers(diff.added) == [6, 7]
    assert (numbers(diff.excluded), numbers(diff.restored), numbers(diff.relabelled)) == ([0, 1, 6], [5], [2, 7])
    assert (diff.balance_before.attempts, diff.balance_before.successes) == (5, 3)
    assert (diff.balance_after.attempts, diff.balance_after.labelled, diff.balance_after.successes) == (5, 5, 2)
    for name, (was, now) in diff.objects.items():
        for balance, table in ((was, before.attempts), (now, after.attempts)):
            rows = table[(table["target"] == name) & ~table["excluded"]]
            assert (balance.attempts, balance.successes) == (len(rows), int(rows["success"].sum()))
        assert was != now


def test_diff_with_an_empty_version(repository: GraspRepository) -> None:
    empty = opened(repository)
    grow(repository, 2)
    assert numbers(diff_versions(empty, opened(repository)).added) == [0, 1]
    assert numbers(diff_versions(opened(repository), empty).removed) == [0, 1]
    assert diff_versions(empty, empty).empty
