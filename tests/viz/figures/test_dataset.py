"""The figure of a dataset, read back: the numbers are in it, and nothing that may be missing breaks it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from tests.support.factories import make_attempt, make_header, record
from tests.support.rrd import colours, read_picture

from handsight.datasets import GraspDataset, GraspRepository, Outcome
from handsight.datasets.reading.stats import Histogram, LabelStats, PositionMap, Share, Window, label_stats
from handsight.evaluation.results import wilson_95
from handsight.viz.errors import FigureError
from handsight.viz.figures.dataset import stats_figure
from handsight.viz.figures.rate_panels import EXTREME_OBJECTS, draw_angles, object_rows

NOTHING = Histogram(edges=(), attempts=(), successes=())


def made_up(objects: int = 3, sessions: int = 2, attempts: int = 30, successes: int = 12) -> LabelStats:
    """Numbers of a dataset in which every object, bin and window has as many attempts and successes."""
    histogram = Histogram(edges=(0.0, 0.5, 1.0), attempts=(attempts, 0), successes=(successes, 0))
    each = [Share(name=f"set/thing-{at:03d}", attempts=attempts, successes=successes) for at in range(objects)]
    windows = [
        Window(session=f"s{at}", first=0, last=attempts - 1, attempts=attempts, successes=successes)
        for at in range(sessions)
    ]
    return LabelStats(
        labelled=attempts,
        successes=successes,
        excluded=4321,
        unlabelled=5678,
        objects=tuple(each),
        sessions=(),
        angle_rad=(),
        width_m=(),
        force_n=(),
        angle_bins_rad=histogram,
        width_bins_m=histogram,
        no_contact=Share(name="no contact", attempts=0, successes=0),
        contact_bins_n=histogram,
        positions=PositionMap(
            x_edges_m=(0.4, 0.5, 0.6),
            y_edges_m=(0.0, 0.1),
            attempts=((attempts,), (0,)),
            successes=((successes,), (0,)),
        ),
        window_attempts=1000,
        windows=tuple(windows),
    )


def svg_of(found: LabelStats, folder: Path, title: str = "grasps@v1") -> str:
    return stats_figure(found, folder / "stats.svg", title=title).read_text()


def test_the_figure_holds_the_numbers(tmp_path: Path) -> None:
    text = svg_of(made_up(), tmp_path)
    assert ">grasps@v1: 12 of 30 labelled attempts succeed, 40.0 %<" in text
    assert ">95 % Wilson interval 24.6 % to 57.7 %; left out: 5,678 without a label, 4,321 excluded<" in text
    for expected in ("thing-000", "thing-002", "Success by object (set)", "in windows of about 1,000 attempts"):
        assert expected in text
    assert "set/thing" not in text
    assert text.count(">30<") >= 3
    assert "2 sessions one after another" in text


def test_the_same_numbers_give_the_same_bytes(tmp_path: Path) -> None:
    for suffix in (".png", ".svg", ".PNG"):
        first, again, other = (
            stats_figure(found, tmp_path / f"{name}{suffix}", title="g").read_bytes()
            for name, found in (("a", made_up()), ("b", made_up()), ("c", made_up(successes=13)))
        )
        assert first == again
        assert first != other
    assert len(list(tmp_path.iterdir())) == 9


def test_a_recorded_dataset_is_drawn(repository_of_attempts: GraspDataset, tmp_path: Path) -> None:
    picture = read_picture(stats_figure(label_stats(repository_of_attempts), tmp_path / "s.png", title="$a_b$"))
    assert picture.shape[1] > picture.shape[0] > 1000
    assert colours(picture) > 100
    assert "$a_b$" in svg_of(label_stats(repository_of_attempts), tmp_path, title="$a_b$")


@pytest.fixture(scope="module")
def repository_of_attempts(tmp_path_factory: pytest.TempPathFactory) -> GraspDataset:
    repository = GraspRepository.create(tmp_path_factory.mktemp("figure") / "grasps")
    outcomes = (Outcome.HELD, Outcome.EMPTY, Outcome.ABORTED, Outcome.EMPTY)
    header = make_header()
    record(repository, header, [make_attempt(header, n, outcome=outcomes[n % 4]) for n in range(24)], every=24)
    return GraspDataset(repository, ref="main")


def test_without_known_targets_the_figure_is_narrower(tmp_path: Path) -> None:
    wide, narrow = (
        read_picture(stats_figure(made_up(objects=count), tmp_path / f"{count}.png", title="g")) for count in (3, 0)
    )
    assert narrow.shape[1] < 0.7 * wide.shape[1]
    assert "Success by object" not in svg_of(made_up(objects=0), tmp_path)


@pytest.mark.parametrize("successes", [0, 30])
def test_one_label_alone_is_drawn(successes: int, tmp_path: Path) -> None:
    found = made_up(successes=successes)
    assert f"succeed, {100 if successes else 0}.0 %" in svg_of(found, tmp_path)
    axes = Figure().add_subplot()
    draw_angles(axes, found.angle_bins_rad, successes / 30)
    low, high = axes.get_ylim()
    assert -0.03 < low < 0.0
    assert wilson_95(successes, 30)[1] < high < 1.03


def test_what_was_not_recorded_is_said(tmp_path: Path) -> None:
    plain = made_up()
    values = {name: getattr(plain, name) for name in plain.__dataclass_fields__}
    values |= dict.fromkeys(("angle_bins_rad", "width_bins_m", "contact_bins_n"), NOTHING)
    values |= {"positions": PositionMap(x_edges_m=(), y_edges_m=(), attempts=(), successes=())}
    text = svg_of(LabelStats(**values), tmp_path)
    for what in ("grasp position", "grasp angle", "opening", "contact force"):
        assert f">no {what} was recorded<" in text
    values |= {"width_bins_m": Histogram(edges=(0.02, 0.02), attempts=(30,), successes=(12,))}
    assert "no opening" not in svg_of(LabelStats(**values), tmp_path)


def test_many_blocks_are_a_line_in_a_band(tmp_path: Path) -> None:
    assert "300 sessions one after another" in svg_of(made_up(sessions=300), tmp_path)


def test_of_many_objects_luck_makes_none_the_best(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    plain = [
        Share(name=f"set/plain-{at:03d}", attempts=100, successes=int(held))
        for at, held in enumerate(rng.integers(20, 40, 898))
    ]
    lucky, good = Share(name="set/lucky", attempts=1, successes=1), Share(name="set/good", attempts=100, successes=90)
    rows = object_rows([lucky, *plain, good])
    assert len(rows) == 2 * EXTREME_OBJECTS + 1
    assert rows[EXTREME_OBJECTS] is None
    assert rows[0] == good
    assert lucky not in rows
    values = made_up()
    found = {name: getattr(values, name) for name in values.__dataclass_fields__} | {"objects": (lucky, *plain, good)}
    text = svg_of(LabelStats(**found), tmp_path)
    assert f"{900 - 2 * EXTREME_OBJECTS} others" in text
    assert "best and worst of 900" in text


def test_what_cannot_be_drawn_is_refused(tmp_path: Path) -> None:
    for path, said in (
        (tmp_path / "stats.jpg", r"ends in \.png or \.svg"),
        (tmp_path / "missing" / "stats.png", "create it first"),
        (tmp_path, "is a folder"),
    ):
        with pytest.raises(FigureError, match=said):
            stats_figure(made_up(), path, title="g")
    with pytest.raises(FigureError, match=r"g@v1 has no labelled attempt"):
        stats_figure(made_up(attempts=0, successes=0), tmp_path / "stats.png", title="g@v1")
    assert list(tmp_path.iterdir()) == []
