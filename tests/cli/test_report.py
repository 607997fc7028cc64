"""``handsight report`` as its user meets it: one page that holds everything."""

from __future__ import annotations

import html
import json
import re
import shlex
from pathlib import Path

import pytest
from tests.support.chromium import picture, visit
from tests.support.factories import make_attempt, make_header, record
from tests.support.html_page import HtmlPage
from tests.support.reports import MARKUP, make_demo, make_evaluation
from tests.support.rrd import colours, read_picture
from tests.support.runs import save_untrained
from tests.support.s3_server import empty_bucket, s3_server

from handsight.cli.app import run
from handsight.datasets import GraspDataset, GraspRepository, Outcome, Selection
from handsight.datasets.curation.curator import Curator
from handsight.datasets.exchange.merge import merge
from handsight.datasets.reading.attempt_ids import resolve_attempt_ids

BUCKET = "s3://lab/week/grasps"


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_demo(tmp_path_factory.mktemp("report") / "demo")


@pytest.fixture(scope="module")
def page(demo: Path) -> Path:
    """The report on the folder of the demo."""
    out = demo.parent / "report.html"
    assert run(["report", str(demo), "--out", str(out)]) == 0
    return out


def said_of(path: Path) -> str:
    """The words of a page whose form is sound."""
    found = HtmlPage(path.read_text())
    assert found.faults() == []
    return " ".join(" ".join(found.words).split())


def test_a_folder_of_the_demo_is_told_whole(demo: Path, page: Path) -> None:
    text = said_of(page)
    dataset = GraspDataset.open(f"{demo / 'grasps'}@v1")
    for said in (
        "Evaluation results.json",
        "33.3 %",
        "Failures by cause",
        f"Run {demo / 'run'}",
        f"Dataset {demo / 'grasps'}@v1",
        dataset.digest,
        dataset.snapshot_id,
        "10 of 30 labelled attempts succeed, 33.3 %",
        "Nothing was decided",
        f"rerun {demo / 'servo_trace.rrd'}",
        f"handsight dataset stats {demo / 'grasps'}@v1 --plot stats.svg",
        f"handsight runs show {demo / 'run'}",
        f"handsight report {demo} --out {page}",
    ):
        assert said in text, said
    assert page.stat().st_size < 5_000_000
    assert len(HtmlPage(page.read_text()).all("img")) >= 6


def calls_of(text: str, *words: str) -> list[list[str]]:
    """The calls on a page that begin with some words, as a shell takes them apart."""
    calls = [shlex.split(html.unescape(re.sub("<[^>]*>", "", code))) for code in re.findall("<code>(.*?)</code>", text)]
    return [call for call in calls if call[: len(words)] == list(words)]


def test_every_picture_of_a_gallery_names_the_call_that_shows_it(
    page: Path, demo: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = page.read_text()
    shown = calls_of(text, "handsight", "dataset", "show")
    assert len(shown) > 2
    dataset = GraspDataset.open(f"{demo / 'grasps'}@v1")
    ((_, _, _, address, *together, option, file),) = calls_of(text, "handsight", "view", "dataset")
    assert (address, option, file) == (f"{demo / 'grasps'}@v1", "--picture", "failed.png")
    assert resolve_attempt_ids(dataset, together) == [call[4] for call in shown]
    monkeypatch.chdir(tmp_path)
    assert run(shown[0][1:]) == 0
    assert (tmp_path / "attempt.png").is_file()
    assert calls_of(text, "handsight", "heatmap")
    for call in calls_of(text, "handsight", "heatmap"):
        assert "--picture" in call or "--wrong" in call


def test_the_same_folder_makes_the_same_page(demo: Path, page: Path) -> None:
    first = page.read_bytes()
    assert run(["report", str(demo), "--out", str(page)]) == 0
    assert page.read_bytes() == first


@pytest.mark.parametrize(("width_px", "dark"), [(1280, False), (500, False), (500, True)])
def test_a_browser_opens_it_without_a_word_and_without_the_network(
    page: Path, tmp_path: Path, width_px: int, dark: bool
) -> None:
    seen = visit(page, tmp_path, width_px=width_px, dark=dark)
    assert seen.console == []
    assert seen.requests == []
    assert "Failures by cause" in seen.text
    shot = read_picture(picture(page, tmp_path, width_px=width_px, dark=dark))
    assert colours(shot) > 50


def test_a_page_that_asks_the_network_and_complains_is_found_out(tmp_path: Path) -> None:
    bad = tmp_path / "bad.html"
    bad.write_text('<img src="http://127.0.0.1:9/x.png"><script>console.error("lost")</script>')
    seen = visit(bad, tmp_path, width_px=1280)
    assert seen.requests == ["http://127.0.0.1:9/x.png"]
    assert "lost" in "".join(seen.console)


def test_a_dataset_is_told_with_what_curation_decided(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    repository = GraspRepository.create(tmp_path / "grasps")
    header = make_header(objects=(MARKUP, "cup", "fork"))
    made = [make_attempt(header, at, outcome=Outcome.HELD if at % 3 == 0 else Outcome.EMPTY) for at in range(12)]
    record(repository, header, made, every=12)
    curator = Curator(repository, author="anna")
    curator.exclude(Selection(where="number == 1"), "<b>blurred</b>")
    curator.relabel(Selection(where="number == 2"), True, "held after all")
    curator.undo(1)
    out = tmp_path / "report.html"
    assert run(["report", str(tmp_path / "grasps"), "--out", str(out), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["bytes"] == out.stat().st_size
    assert {"Doctor", "Balance of labels", "Curation", "Failed attempts", "Lineage"} <= set(told["sections"])
    text = said_of(out)
    for said in (MARKUP, "<b>blurred</b>", "relabel as success (undone)", "undo decision 1", "anna"):
        assert said in text, said


def test_a_dataset_in_a_bucket_is_told_like_one_in_a_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("HANDSIGHT_CACHE", str(tmp_path / "cache"))
    source = GraspRepository.create(tmp_path / "grasps")
    header = make_header(width=64, height=48)
    record(source, header, [make_attempt(header, at, outcome=Outcome(at % 2)) for at in range(8)])
    with s3_server() as server:
        empty_bucket(server, monkeypatch)
        merge(GraspDataset(source, ref="main"), GraspRepository.create(BUCKET))
        pages = {}
        for place in (str(tmp_path / "grasps"), BUCKET):
            out = tmp_path / "report.html"
            assert run(["report", place, "--out", str(out)]) == 0, capsys.readouterr().err
            pages[place] = out.read_text()
    pictures = [[one["src"] for one in HtmlPage(text).all("img")] for text in pages.values()]
    assert pictures[0] == pictures[1]
    assert len(pictures[0]) >= 2
    assert ["handsight", "dataset", "stats", BUCKET, "--plot", "stats.svg"] in calls_of(pages[BUCKET], "handsight")
    assert str(tmp_path / "grasps") not in pages[BUCKET]


def test_a_run_is_told_with_its_curve_and_limits(tmp_path: Path) -> None:
    save_untrained(tmp_path / "run")
    assert run(["report", str(tmp_path / "run"), "--out", str(tmp_path / "run.html")]) == 0
    text = said_of(tmp_path / "run.html")
    for said in ("lab/grasps@v1", "pass 2 of 3", "0.875", "2 (kept)", "A score is", "as the record names them"):
        assert said in text, said


def test_failed_trials_are_not_simulated_where_that_is_not_asked_for(demo: Path, tmp_path: Path) -> None:
    assert run(["report", str(demo), "--replays", "0", "--out", str(tmp_path / "x.html")]) == 0
    assert "simulated again" not in said_of(tmp_path / "x.html")


def test_an_evaluation_alone_is_told(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "results.json").write_text(json.dumps(make_evaluation(objects=MARKUP, model=MARKUP)))
    assert run(["report", str(tmp_path / "in"), "--out", str(tmp_path / "x.html")]) == 0
    assert MARKUP in said_of(tmp_path / "x.html")


REFUSED = {
    "nothing there": ("{nowhere}", "there is no dataset"),
    "a file": ("{file}", "is a file, expected a folder"),
    "a folder of nothing": ("{folder}", "holds nothing that a report can tell of"),
    "an empty dataset": ("{empty}", "holds no attempt, expected some"),
    "a version that is not there": ("{data}@v9", "v9"),
    "a page of another kind": ("{data} --out {folder}/x.pdf", "ends in .html"),
    "a folder that is not there": ("{data} --out {nowhere}/x.html", "there is no folder"),
    "a damaged evaluation": ("{damaged}", "is damaged (rows[0].rate is 7"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_told_is_refused_in_one_line(
    name: str, demo: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words, said = REFUSED[name]
    places = {one: tmp_path / one for one in ("nowhere", "file", "folder", "empty", "damaged")}
    places["file"].write_text("x")
    places["folder"].mkdir()
    GraspRepository.create(places["empty"])
    places["damaged"].mkdir()
    broken = make_evaluation()
    broken["rows"][0]["rate"] = 7
    (places["damaged"] / "results.json").write_text(json.dumps(broken))
    call = [word.format(**places, data=demo / "grasps") for word in words.split()]
    out = [] if "--out" in call else ["--out", str(tmp_path / "out.html")]
    assert run(["report", *call, *out]) == 2
    captured = capsys.readouterr()
    (line,) = captured.err.splitlines()
    assert said in line
    assert not (tmp_path / "out.html").exists()
