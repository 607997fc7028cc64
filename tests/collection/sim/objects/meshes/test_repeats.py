"""Triangles that lie on one another."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from tests.support.meshes import block

from handsight.collection.sim.objects.meshes.fault import MeshFault
from handsight.collection.sim.objects.meshes.mesh_file import check_mesh
from handsight.collection.sim.objects.meshes.repeats import without_repeats
from handsight.collection.sim.objects.meshes.solid import make_solid

BOX = np.asarray(block().faces)


def of_faces(faces: np.ndarray) -> trimesh.Trimesh:
    return trimesh.Trimesh(vertices=block().vertices, faces=faces, process=False)


@given(
    extra=st.lists(st.tuples(st.integers(0, 11), st.integers(0, 2)), max_size=20),
    order=st.randoms(use_true_random=False),
)
def test_a_closed_box_is_the_same_however_often_its_triangles_stand_there(
    extra: list[tuple[int, int]], order: np.random.Generator
) -> None:
    faces = [*BOX, *(np.roll(BOX[face], turn) for face, turn in extra)]
    order.shuffle(faces)
    mesh = of_faces(np.array(faces))
    solid = make_solid(mesh)
    assert solid.volume_m3 == pytest.approx(0.05**3)
    assert len(solid.surface.faces) == len(mesh.faces) == 12


@pytest.mark.parametrize("inside_out", [False, True])
def test_a_surface_written_for_both_sides_is_one_surface(inside_out: bool) -> None:
    first = BOX[:, ::-1] if inside_out else BOX
    mesh = of_faces(np.concatenate([first, first[:, ::-1]]))
    assert make_solid(mesh).volume_m3 == pytest.approx(0.05**3)
    assert len(mesh.faces) == 12
    away = np.einsum("ij,ij->i", mesh.face_normals, mesh.triangles_center)
    assert (away > 0).all()


def test_a_triangle_that_is_there_once_more_the_other_way_round_goes() -> None:
    mesh = of_faces(np.concatenate([BOX, BOX[4:5, ::-1]]))
    assert make_solid(mesh).volume_m3 == pytest.approx(0.05**3)


def test_the_wall_between_two_bodies_that_share_it_goes() -> None:
    left, right = block(), block()
    # Mirrored at the wall, so that both have the same triangles there.
    right.apply_transform(np.diag([-1.0, 1.0, 1.0, 1.0]))
    right.apply_translation((0.05, 0, 0))
    solid = make_solid(left + right)
    assert solid.volume_m3 == pytest.approx(2 * 0.05**3)
    assert len(solid.bodies) == 1


def test_a_sheet_written_for_both_sides_stays_open() -> None:
    with pytest.raises(MeshFault, match="is not watertight"):
        make_solid(of_faces(np.concatenate([BOX[:4], BOX[:4, ::-1]])))


def test_nothing_is_left_out_where_nothing_repeats() -> None:
    assert without_repeats(BOX).tolist() == list(range(12))


def test_a_file_with_a_triangle_twice_is_imported(tmp_path: Path) -> None:
    of_faces(np.concatenate([BOX, BOX[3:4]])).export(tmp_path / "twice.ply")
    assert check_mesh(tmp_path / "twice.ply", root=tmp_path, scale=1.0).solid.volume_m3 == pytest.approx(0.05**3)
