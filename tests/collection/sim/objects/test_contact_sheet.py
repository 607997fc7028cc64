"""The picture of a whole object set."""

from __future__ import annotations

from pathlib import Path

from handsight.collection.sim.objects.contact_sheet import TILE_PX, contact_sheet
from handsight.collection.sim.objects.manifest import load_models


def test_the_contact_sheet_shows_every_object(household: Path) -> None:
    models = load_models(household, splits=("test",))
    sheet = contact_sheet(models, columns=4)
    assert sheet.shape == (3 * TILE_PX, 4 * TILE_PX, 3)
    tiles = sheet.reshape(3, TILE_PX, 4, TILE_PX, 3).swapaxes(1, 2).reshape(12, -1)
    assert [bool((tile < 250).mean() > 0.03) for tile in tiles] == [True] * 10 + [False] * 2
