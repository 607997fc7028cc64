"""Material libraries: the options that legally stand before a picture's name, and what makes no sense."""

from __future__ import annotations

import pytest

from handsight.collection.sim.objects.meshes.fault import MeshFault
from handsight.collection.sim.objects.meshes.mtl import Material, read_mtl


def material(statement: str) -> Material:
    return read_mtl(f"newmtl m\n{statement}\n".encode())["m"]


@pytest.mark.parametrize(
    ("statement", "picture"),
    [
        ("map_Kd t.png", "t.png"),
        ("map_Kd -s 1 1 1 t.png", "t.png"),
        ("map_Kd -s 2 t.png", "t.png"),
        ("map_Kd -clamp on t.png", "t.png"),
        ("map_Kd -bm 1.5 t.png", "t.png"),
        ("map_Kd -mm 0 1 t.png", "t.png"),
        ("map_Kd -blendu off -blendv on -boost 2 -texres 512 -imfchan m t.png", "t.png"),
        ("map_Kd -o 0 0 0 -s 1 1 1 -t 0 0 0 two words.png", "two words.png"),
        ("map_Kd -s 1 1 1 3", "3"),
        ("map_Kd -dash.png", "-dash.png"),
        ('map_Kd "two words.png"', "two words.png"),
        ("map_Kd folder\\t.png", "folder\\t.png"),
        ("MAP_KD\tt.png", "t.png"),
    ],
)
def test_a_picture_is_found_behind_its_options(statement: str, picture: str) -> None:
    assert material(statement).picture == picture


def test_scale_and_offset_are_kept() -> None:
    found = material("map_Kd -s 2 3 1 -o 0.5 t.png")
    assert (found.repeat, found.offset) == ((2.0, 3.0), (0.5, 0.0))


def test_colours_are_clipped_and_other_models_of_colour_left_out() -> None:
    assert material("Kd 0.5 7 -1").colour == (0.5, 1.0, 0.0)
    assert material("Kd 0.5").colour == (0.5, 0.5, 0.5)
    assert material("Kd spectral paint.rfl 1").colour is None


@pytest.mark.parametrize(
    ("statement", "fault"),
    [
        ("Kd 1 1 nan", "line 2: Kd holds 'nan', expected a finite number"),
        ("Kd 1e999 0 0", "line 2: Kd holds '1e999'"),
        ("Kd 1 1", "line 2: Kd has 2 numbers"),
        ("map_Kd -mm 0", "line 2: map_Kd '-mm 0' names no file"),
        ("map_Kd -s x t.png", "line 2: map_Kd has option -s with"),
        ("map_Kd -s", "line 2: map_Kd has option -s with"),
        ("map_Kd -s 1e999 t.png", "line 2: map_Kd -s holds '1e999'"),
    ],
)
def test_a_statement_that_makes_no_sense_is_named(statement: str, fault: str) -> None:
    with pytest.raises(MeshFault, match=fault):
        material(statement)
