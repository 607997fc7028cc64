"""The scene of a servo trace is the surface that the overhead camera measured."""

from __future__ import annotations

import dataclasses

import numpy as np

from handsight.evaluation.trial import TrialRecording
from handsight.viz import palette
from handsight.viz.recordings.scene import OBJECT_HEIGHT_M, STRIDE_PX, back_project, objects_mesh, table_colour


def test_the_table_is_lifted_to_height_zero(trial: TrialRecording) -> None:
    field = back_project(trial.overhead, trial.station)
    height_m = field.points_m[..., 2]
    assert np.abs(np.median(height_m)) < 1e-3
    assert field.points_m.shape == (*trial.overhead.depth[::STRIDE_PX, ::STRIDE_PX].shape, 3)


def test_objects_are_lifted_to_where_they_came_to_rest(trial: TrialRecording) -> None:
    scene = trial.scene
    assert scene is not None
    field = back_project(trial.overhead, trial.station)
    raised_m = field.points_m[field.points_m[..., 2] > OBJECT_HEIGHT_M]
    (x_low, y_low, _), (x_high, y_high, _) = field.points_m.min((0, 1)), field.points_m.max((0, 1))
    seen = 0
    for x_m, y_m in scene.pose_base_object[:, :2].tolist():
        if x_low + 0.05 < x_m < x_high - 0.05 and y_low + 0.05 < y_m < y_high - 0.05:
            seen += 1
            assert np.hypot(raised_m[:, 0] - x_m, raised_m[:, 1] - y_m).min() < 0.02
    assert seen >= 2


def test_the_mesh_stands_on_the_table_and_has_only_its_own_corners(trial: TrialRecording) -> None:
    mesh = objects_mesh(back_project(trial.overhead, trial.station))
    assert mesh is not None
    assert mesh.vertex_positions is not None
    assert mesh.triangle_indices is not None
    points_m = np.array(mesh.vertex_positions.as_arrow_array().to_pylist())
    triangles = np.array(mesh.triangle_indices.as_arrow_array().to_pylist())
    assert set(np.unique(triangles)) == set(range(len(points_m)))
    feet = points_m[:, 2] == 0
    assert 0 < feet.sum() < len(points_m)
    assert (points_m[~feet, 2] > OBJECT_HEIGHT_M).all()
    # A foot stands right under an edge: its wall is vertical.
    heads_m = points_m[~feet]
    for foot_m in points_m[feet][:50]:
        assert np.abs(heads_m[:, :2] - foot_m[:2]).max(1).min() == 0


def test_a_bare_table_has_no_mesh(trial: TrialRecording) -> None:
    depth = np.full_like(trial.overhead.depth, np.median(trial.overhead.depth))
    bare = dataclasses.replace(trial.overhead, depth=depth)
    assert objects_mesh(back_project(bare, trial.station)) is None


def test_pixels_without_depth_are_no_surface(trial: TrialRecording) -> None:
    blind = dataclasses.replace(trial.overhead, depth=np.zeros_like(trial.overhead.depth))
    field = back_project(blind, trial.station)
    assert not field.valid.any()
    assert objects_mesh(field) is None
    assert table_colour(field) == palette.STEEL
