"""What is edited in the table becomes a decision, and nothing else does."""

from __future__ import annotations

import pytest

from handsight.datasets import GraspDataset
from handsight.datasets.curation.curator import Curator
from handsight.viz.browser.decisions import Edit, Row, decide, edits_between

ROWS = {
    "a": Row(excluded=False, label="success"),
    "b": Row(excluded=True, label="failure"),
    "c": Row(excluded=False, label="-"),
}


@pytest.mark.parametrize(
    ("cell", "edits", "senseless"),
    [
        (("a", False, "success"), [], []),
        (("a", True, "success"), [Edit(attempt="a", act="exclude")], []),
        (("b", False, "failure"), [Edit(attempt="b", act="restore")], []),
        (("a", False, "failure"), [Edit(attempt="a", act="relabel", label="failure")], []),
        (("b", True, " Success"), [Edit(attempt="b", act="relabel", label="success")], []),
        (("a", False, ""), [Edit(attempt="a", act="unlabel")], []),
        (("a", False, "maybe"), [], ["a"]),
        (("a", False, "SUCCESS"), [], ["a"]),
        (("c", False, "success"), [], ["c"]),
        (("elsewhere", True, "success"), [], []),
    ],
)
def test_what_an_edited_cell_means(cell: tuple[str, bool, str], edits: list[Edit], senseless: list[str]) -> None:
    assert edits_between(ROWS, [cell]) == (edits, senseless)


def test_every_edit_is_a_decision_of_its_own(dataset: GraspDataset) -> None:
    labelled = [str(key) for key in dataset.attempts.index[dataset.attempts["success"].notna()]]
    one, two = labelled[:2]
    wrong = "failure" if dataset.attempts["success"][two] else "success"
    edits = [
        Edit(attempt=one, act="exclude"),
        Edit(attempt=two, act="relabel", label=wrong),
        Edit(attempt=one, act="restore"),
        Edit(attempt=two, act="unlabel"),
        Edit(attempt="01M8D7AEHT2D4A36HWXR6AQSTZ-000000", act="exclude"),
    ]
    done = decide(Curator(dataset.repository, author="me"), edits)
    assert [None if one.decision is None else one.decision.number for one in done] == [0, 1, 2, 3, None]
    assert "there is no attempt" in done[-1].refused
    again = GraspDataset.open(str(dataset.repository.path))
    assert again.attempts["success"].equals(dataset.attempts["success"])
    assert not again.attempts["excluded"].any()
