from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from tests.support.reports import make_evaluation

from handsight.viz.errors import ReportError
from handsight.viz.report.evaluation_file import check_evaluation, is_evaluation, read_json


def test_what_evaluate_prints_is_known_and_sound(tmp_path: Path) -> None:
    path = tmp_path / "results.json"
    path.write_text(json.dumps(make_evaluation()))
    values = read_json(path)
    assert is_evaluation(values)
    check_evaluation(path, values)
    assert not is_evaluation([values])
    assert not is_evaluation({"rows": []})


@pytest.mark.parametrize("text", ["", "{", "[NaN]", "\udcff", "[" * 100_000])
def test_what_is_no_json_is_refused(text: str, tmp_path: Path) -> None:
    (tmp_path / "x.json").write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(ReportError, match=r"x\.json is no JSON"):
        read_json(tmp_path / "x.json")


@pytest.mark.parametrize(
    ("table", "key", "value"),
    [
        ("rows", "rate", 1.5),
        ("rows", "rate", "0.5"),
        ("rows", "ci95", [0.1]),
        ("rows", "successes", -1),
        ("rows", "method", None),
        ("causes", "causes", {"arm blocked": "often"}),
        ("calibration", "mean_score", True),
        ("trials", "success", 1),
        ("durations", "limit", None),
    ],
)
def test_a_value_that_none_can_have_is_named(table: str, key: str, value: Any) -> None:
    values = make_evaluation()
    values[table][1][key] = value
    with pytest.raises(ReportError, match=rf"results\.json is damaged \({table}\[1\]\.{key} is"):
        check_evaluation(Path("results.json"), values)


def test_all_faults_are_counted() -> None:
    values = make_evaluation()
    for row in values["trials"]:
        row["number"] = -1
    values["model"] = 7
    values["comparisons"] = None
    values["durations"][0] = "many"
    with pytest.raises(ReportError, match=r"model is 7, expected text.*and 10 more"):
        check_evaluation(Path("results.json"), values)
    with pytest.raises(ReportError, match="rows has 0 rows, expected at least one"):
        check_evaluation(Path("results.json"), {**make_evaluation(), "rows": []})
