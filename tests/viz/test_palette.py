"""Every two colours that mean different things side by side are told apart, whatever cones one has."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from tests.support.vision import Colour, contrast, distances, lab, linear

from handsight.viz import palette
from handsight.viz.figures.style import HATCHES, SERIES

LEAST = 25.0
"""In CIELAB; 2 is a difference that can just be seen, side by side and with large patches."""
OLD_LABELS = {"held": (76, 217, 100), "empty": (255, 69, 58)}
OLD_SERIES = ("#1b5e9e", "#d0661a", "#4d4d4d", "#00a08a", "#8d4fa8", "#b3a100")


def confused(group: dict[str, Colour]) -> list[str]:
    """Pairs of a group that somebody takes for one another."""
    return [
        f"{one} and {other}: {distance:.1f} with {seeing}"
        for one, other in combinations(group, 2)
        for seeing, distance in distances(group[one], group[other]).items()
        if distance < LEAST
    ]


@pytest.mark.parametrize("group", palette.TOLD_APART)
def test_colours_that_mean_different_things_are_told_apart(group: str) -> None:
    colours: dict[str, Colour] = dict(palette.TOLD_APART[group])
    assert len(colours) > 1
    assert confused(colours) == []


def test_the_palettes_that_were_mistaken_are_found_out() -> None:
    assert confused(dict(OLD_LABELS)) == ["held and empty: 17.8 with deuteranopia"]
    assert len(confused({ink: ink for ink in OLD_SERIES})) > 2


def test_distances_are_those_of_known_colours() -> None:
    np.testing.assert_allclose(lab(linear((255, 0, 0))), [53.24, 80.09, 67.20], atol=0.02)
    np.testing.assert_allclose(lab(linear("#ffffff")), [100, 0, 0], atol=0.02)
    assert contrast("#000000", "#ffffff") == pytest.approx(21)
    # Whoever lacks the green cones sees greys as they are.
    assert distances("#808080", "#404040")["deuteranopia"] == pytest.approx(
        distances("#808080", "#404040")["all cones"], abs=0.1
    )


def test_lines_bars_and_labels_have_a_second_cue() -> None:
    assert len({series.marker for series in SERIES}) == len({str(series.dash) for series in SERIES}) == len(SERIES)
    assert len(set(HATCHES)) == len(HATCHES) == len(palette.SET_INKS)


def test_inks_are_dark_enough_for_white_paper() -> None:
    assert all(contrast(series.ink, "#ffffff") >= 3 for series in SERIES)
    assert all(contrast(ink, "#ffffff") >= 4.5 for ink in palette.SET_INKS), "numbers on them are white"
    for colour in (palette.HELD, palette.EMPTY):
        assert min(contrast(colour, "#ffffff"), contrast(colour, "#0d1011")) >= 3
