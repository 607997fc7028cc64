"""A recorded servo run, read back: what the viewer shows is what the trace holds."""

from __future__ import annotations

import dataclasses
import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import torch
from numpy.typing import NDArray
from tests.support.rrd import Content, at, decode, read_recording, scalars, verify

from handsight.collection.sim.arm_shape import Ur10Shape
from handsight.evaluation.trial import TrialRecording
from handsight.servoing.heatmap import Heatmap
from handsight.viz import palette
from handsight.viz.errors import RecordingError, VizError
from handsight.viz.recordings.layouts import OUTSIDE
from handsight.viz.recordings.servo_trace import write_servo_trace
from handsight.viz.recordings.trace_log import MOST_SAMPLES

TIMELINE = "servo_step"
CAMERA = "/world/tool/camera"
ENTITIES = {
    "/world/table",
    "/world/objects/seen",
    "/world/objects/poses",
    "/world/tool",
    "/world/tool/gripper",
    CAMERA,
    f"{CAMERA}/rgb",
    f"{CAMERA}/muted",
    f"{CAMERA}/heat",
    f"{CAMERA}/contour/line",
    f"{CAMERA}/scale",
    "/world/arm/base_link",
    "/world/arm/wrist_3_link",
    "/next/predicted",
    "/next/observed",
    "/next/difference",
    "/plots/time/look_ms",
    "/plots/time/compute_ms",
    f"{CAMERA}/depth",
    f"{CAMERA}/samples/score",
    f"{CAMERA}/arrow",
    f"{CAMERA}/text",
    f"{CAMERA}/jaws/here/line",
    f"{CAMERA}/jaws/chosen/line",
    f"{CAMERA}/jaws/grasp/line",
    "/world/trajectory/path",
    "/world/grasp/jaws",
    "/world/grasp/descent",
    "/input/rgb",
    "/input/height",
    "/plots/score/here",
    "/plots/score/predicted",
    "/plots/score/threshold",
    "/plots/step/dx_mm",
    "/plots/step/dy_mm",
    "/plots/turn/dangle_deg",
    "/text/trial",
    "/text/steps",
}


@pytest.fixture(scope="module")
def content(trace_path: Path) -> Content:
    return read_recording(trace_path, timeline=TIMELINE)


def rgba(colour: palette.Rgb) -> int:
    red, green, blue = colour
    return red << 24 | green << 16 | blue << 8 | 0xFF


def test_every_entity_is_there(content: Content) -> None:
    assert set(content) >= ENTITIES


def test_rerun_finds_nothing_wrong_with_the_file(trace_path: Path) -> None:
    result = verify(trace_path)
    assert result.returncode == 0, result.stdout + result.stderr


def test_a_run_of_twelve_steps_stays_under_three_megabytes(
    trial: TrialRecording, heatmaps: list[Heatmap], arm: Ur10Shape, tmp_path: Path
) -> None:
    first = trial.trace.steps[0]
    steps = (first,) * 11 + trial.trace.steps[-1:]
    longer = dataclasses.replace(trial, trace=dataclasses.replace(trial.trace, steps=steps))
    write_servo_trace(tmp_path / "long.rrd", longer, [heatmaps[0]] * 12, arm=arm)
    assert (tmp_path / "long.rrd").stat().st_size <= 3_000_000


def test_plotted_scores_are_those_of_the_trace(content: Content, trial: TrialRecording) -> None:
    steps = trial.trace.steps
    assert scalars(content, "/plots/score/here") == [(k, step.score) for k, step in enumerate(steps)]
    assert scalars(content, "/plots/score/predicted") == [
        (k, step.predicted) for k, step in enumerate(steps) if step.proposal
    ]
    assert scalars(content, "/plots/score/threshold") == [(k, trial.trace.threshold) for k in range(len(steps))]


def test_plotted_steps_are_those_of_the_trace(content: Content, trial: TrialRecording) -> None:
    chosen = {k: step.proposal.step.tolist() for k, step in enumerate(trial.trace.steps) if step.proposal}
    units = (("step/dx_mm", 1e3), ("step/dy_mm", 1e3), ("turn/dangle_deg", 180 / math.pi))
    for index, (name, unit) in enumerate(units):
        expected = {k: unit * step[index] for k, step in chosen.items()}
        assert dict(scalars(content, f"/plots/{name}")) == pytest.approx(expected)


def test_plotted_times_are_those_of_the_trace(content: Content, trial: TrialRecording) -> None:
    for name in ("look", "compute"):
        expected = [(k, 1e3 * getattr(step, f"{name}_s")) for k, step in enumerate(trial.trace.steps)]
        assert scalars(content, f"/plots/time/{name}_ms") == expected


def test_the_view_foreseen_stands_beside_the_one_that_came(content: Content, trial: TrialRecording) -> None:
    """At each step what the homography predicted of the chosen step, what was then seen, and how they differ."""
    steps = trial.trace.steps
    for k, (step, after) in enumerate(pairwise(steps)):
        assert step.predicted_inputs is not None
        for name, inputs in (("predicted", step.predicted_inputs), ("observed", after.inputs)):
            rgb = decode(at(content[f"/next/{name}"]["EncodedImage:blob"], k)[0])
            expected = np.clip(inputs[:3].numpy().transpose(1, 2, 0), 0, 1)
            np.testing.assert_allclose(rgb / 255, expected, atol=0.5 / 255 + 1e-6)
        raw = np.array(at(content["/next/difference"]["DepthImage:buffer"], k)[0], dtype=np.uint8).view(np.float32)
        differs = (step.predicted_inputs[:3] - after.inputs[:3]).abs().mean(0).numpy()
        np.testing.assert_allclose(raw, differs.ravel(), atol=1e-6)
    last = len(steps) - 1
    assert at(content["/next/predicted/note"]["Points2D:labels"], last) == ["no next view"]
    assert not decode(at(content["/next/predicted"]["EncodedImage:blob"], last)[0]).any()


def test_the_arm_stands_with_its_flange_over_the_fingertips(content: Content, trial: TrialRecording) -> None:
    """From the last link it is 92 mm to the flange and 160 mm more to the fingertips, along its y axis."""
    link = content["/world/arm/wrist_3_link"]
    for k, step in enumerate(trial.trace.steps):
        origin_m = np.array(at(link["Transform3D:translation"], k)[0])
        matrix = np.array(at(link["Transform3D:mat3x3"], k)[0]).reshape(3, 3, order="F")
        tip_m = origin_m + (0.0922 + 0.160) * matrix[:, 1]
        np.testing.assert_allclose(tip_m, [step.pose.x_m, step.pose.y_m, trial.station.pregrasp_height_m], atol=1e-3)
    vertices = content["/world/arm/base_link"]["Mesh3D:vertex_positions"]
    assert [time for time, _ in vertices] == [None]


def test_a_gradient_is_drawn_uphill_and_plotted(trial: TrialRecording, tmp_path: Path) -> None:
    first = trial.trace.steps[0]
    assert first.proposal is not None
    proposal = dataclasses.replace(first.proposal, gradient=torch.tensor([0.3, -0.4, 0.1]))
    steps = (dataclasses.replace(first, proposal=proposal), *trial.trace.steps[1:])
    sloped = dataclasses.replace(trial, trace=dataclasses.replace(trial.trace, steps=steps))
    write_servo_trace(tmp_path / "trace.rrd", sloped)
    content = read_recording(tmp_path / "trace.rrd", timeline=TIMELINE)
    vector_px = np.array(at(content[f"{CAMERA}/gradient"]["Arrows2D:vectors"], 0)[0])
    np.testing.assert_allclose(vector_px / np.linalg.norm(vector_px), [0.6, -0.8], atol=1e-4)
    assert dict(scalars(content, "/plots/gradient/y"))[0] == pytest.approx(-0.4)


@pytest.mark.parametrize(("closed_m", "cause"), [(0.0, "at the table, closed on nothing"), (0.03, "gripped and lost")])
def test_a_failure_is_told_with_its_cause(trial: TrialRecording, tmp_path: Path, closed_m: float, cause: str) -> None:
    failed = dataclasses.replace(
        trial.trial,
        success=False,
        failure="",
        truth_held=False,
        contact_force_n=0.0,
        contact_height_m=0.0,
        closed_m=closed_m,
        lifted_m=0.0,
        final_m=0.0,
    )
    write_servo_trace(tmp_path / "trace.rrd", dataclasses.replace(trial, trial=failed))
    content = read_recording(tmp_path / "trace.rrd", timeline=TIMELINE)
    assert cause in content["/text/trial"]["TextDocument:text"][-1][1][0]
    (((_, told),)) = content["/__properties/trial"]["cause"]
    assert cause in told[0]


def test_many_samples_are_cut_to_the_best(trial: TrialRecording, tmp_path: Path) -> None:
    first = trial.trace.steps[0]
    assert first.proposal is not None
    scores = torch.linspace(0, 1, 2 * MOST_SAMPLES)
    crowd = dataclasses.replace(first.proposal, samples=torch.zeros(len(scores), 3), scores=scores)
    steps = (dataclasses.replace(first, proposal=crowd), *trial.trace.steps[1:])
    write_servo_trace(
        tmp_path / "trace.rrd", dataclasses.replace(trial, trace=dataclasses.replace(trial.trace, steps=steps))
    )
    content = read_recording(tmp_path / "trace.rrd", timeline=TIMELINE)
    shown = at(content[f"{CAMERA}/samples/score"]["score"], 0)
    np.testing.assert_allclose(shown, scores[MOST_SAMPLES:].numpy())


def test_the_tool_stands_where_the_trace_says(content: Content, trial: TrialRecording) -> None:
    translations = content["/world/tool"]["Transform3D:translation"]
    assert [time for time, _ in translations] == list(range(len(trial.trace.steps)))
    for (_, translation_m), step in zip(translations, trial.trace.steps, strict=True):
        expected_m = (step.pose.x_m, step.pose.y_m, trial.station.pregrasp_height_m)
        assert translation_m[0] == pytest.approx(expected_m, abs=1e-6)


def test_the_trajectory_grows_by_one_stop_a_step(content: Content) -> None:
    for time, strips in content["/world/trajectory/path"]["LineStrips3D:strips"]:
        assert time is not None
        assert len(strips[0]) == time + 1


def test_depth_comes_back_exactly_and_colour_nearly(content: Content, trial: TrialRecording) -> None:
    unit_m = trial.station.depth_scale_m
    for k, step in enumerate(trial.trace.steps):
        depth = decode(at(content[f"{CAMERA}/depth"]["EncodedDepthImage:blob"], k)[0])
        np.testing.assert_array_equal(depth, np.rint(step.view.depth_m / unit_m).astype(np.uint16))
        rgb = decode(at(content[f"{CAMERA}/rgb"]["EncodedImage:blob"], k)[0])
        assert np.abs(rgb.astype(int) - step.view.rgb).mean() < 3


def test_network_inputs_come_back(content: Content, trial: TrialRecording) -> None:
    for k, step in enumerate(trial.trace.steps):
        rgb = decode(at(content["/input/rgb"]["EncodedImage:blob"], k)[0])
        np.testing.assert_allclose(rgb.transpose(2, 0, 1) / 255, step.inputs[:3].numpy(), atol=0.5 / 255 + 1e-6)
        height = np.array(at(content["/input/height"]["DepthImage:buffer"], k)[0], dtype=np.uint8).view(np.float32)
        np.testing.assert_allclose(height, np.maximum(-step.inputs[3].numpy(), 0).ravel())


def test_samples_carry_their_scores_and_colours(content: Content, trial: TrialRecording) -> None:
    samples = content[f"{CAMERA}/samples/score"]
    for k, step in enumerate(trial.trace.steps):
        if step.proposal:
            np.testing.assert_allclose(at(samples["score"], k), step.proposal.scores.numpy())
            expected = [rgba(tuple(colour)) for colour in palette.score_rgb(step.proposal.scores).tolist()]
            assert at(samples["Points2D:colors"], k) == expected


def test_the_pass_that_ended_the_run_takes_the_candidates_away(content: Content, trial: TrialRecording) -> None:
    last = len(trial.trace.steps) - 1
    assert trial.trace.steps[last].proposal is None
    for entity in ("samples", "arrow", "jaws/chosen"):
        assert at(content[f"{CAMERA}/{entity}"]["Clear:is_recursive"], last) == [True]


@pytest.mark.parametrize("success", [True, False])
def test_the_last_step_shows_grasp_and_label(trial: TrialRecording, tmp_path: Path, success: bool) -> None:
    labelled = dataclasses.replace(trial, trial=dataclasses.replace(trial.trial, success=success))
    write_servo_trace(tmp_path / "trace.rrd", labelled)
    content = read_recording(tmp_path / "trace.rrd", timeline=TIMELINE)
    last = len(trial.trace.steps) - 1
    colour = rgba(palette.HELD if success else palette.EMPTY)
    assert content[f"{CAMERA}/jaws/grasp/line"]["LineStrips2D:colors"] == [(last, [colour])]
    assert content["/world/grasp/jaws"]["Boxes3D:colors"] == [(last, [colour])]
    label = at(content[f"{CAMERA}/text"]["Points2D:labels"], last)[0]
    assert label == f"{'held' if success else 'empty'} · S {trial.trace.grasp_score:.2f}"
    assert f"{CAMERA}/heat" not in content


def test_a_return_to_an_earlier_pose_is_an_arrow_from_the_last(trial: TrialRecording, tmp_path: Path) -> None:
    first = trial.trace.steps[0]
    back = dataclasses.replace(trial.trace, grasp_pose=first.pose, grasp_score=first.score, confident=False)
    write_servo_trace(tmp_path / "trace.rrd", dataclasses.replace(trial, trace=back))
    content = read_recording(tmp_path / "trace.rrd", timeline=TIMELINE)
    last = len(trial.trace.steps) - 1
    view = trial.trace.steps[last].view
    step = trial.trace.steps[last].pose.step_to(first.pose)
    focal = np.array([view.camera.intrinsics.fx, view.camera.intrinsics.fy])
    expected_px = np.array([step.dx_m, step.dy_m]) * focal / view.plane_m
    vector_px = at(content[f"{CAMERA}/arrow"]["Arrows2D:vectors"], last)[0]
    assert vector_px == pytest.approx(expected_px.tolist(), abs=1e-3)
    assert at(content["/world/grasp/jaws"]["Transform3D:translation"], last)[0][:2] == pytest.approx(
        [first.pose.x_m, first.pose.y_m], abs=1e-6
    )
    assert "best pose seen" in content["/text/trial"]["TextDocument:text"][0][1][0]


@pytest.fixture(scope="module")
def outside(trial: TrialRecording) -> list[NDArray[np.uint8]]:
    """One plain picture per step, each of its own grey."""
    return [np.full((60, 80, 3), 40 + 10 * number, np.uint8) for number in range(len(trial.trace.steps))]


def test_pictures_from_outside_are_shown_step_by_step(
    trial: TrialRecording, outside: list[NDArray[np.uint8]], tmp_path: Path
) -> None:
    write_servo_trace(tmp_path / "trace.rrd", trial, outside=outside)
    blobs = read_recording(tmp_path / "trace.rrd", timeline=TIMELINE)[OUTSIDE]["EncodedImage:blob"]
    assert [time for time, _ in blobs] == list(range(len(outside)))
    for (_, blob), picture in zip(blobs, outside, strict=True):
        assert np.abs(decode(blob[0]).astype(int) - picture).max() <= 2


def test_without_pictures_from_outside_there_is_no_view_for_them(content: Content) -> None:
    assert OUTSIDE not in content


def test_pictures_from_outside_that_do_not_fit_are_refused(
    trial: TrialRecording, outside: list[NDArray[np.uint8]], tmp_path: Path
) -> None:
    with pytest.raises(RecordingError, match=r"got 1 outside picture for \d+ servo steps"):
        write_servo_trace(tmp_path / "trace.rrd", trial, outside=outside[:1])
    with pytest.raises(RecordingError, match=r"\(30, 80, 3\), \(60, 80, 3\).*expected one shape"):
        write_servo_trace(tmp_path / "trace.rrd", trial, outside=[outside[0][:30], *outside[1:]])
    assert list(tmp_path.iterdir()) == []


def test_objects_are_named_where_they_came_to_rest(content: Content, trial: TrialRecording) -> None:
    scene = trial.scene
    assert scene is not None
    poses = content["/world/objects/poses"]
    assert poses["Points3D:labels"][0][1] == [trial.station.objects[index] for index in scene.catalogue_index]
    positions_m = np.array(poses["Points3D:positions"][0][1])
    np.testing.assert_allclose(positions_m[:, :2], scene.pose_base_object[:, :2], atol=1e-6)


def test_the_summary_says_how_it_went(content: Content, trial: TrialRecording) -> None:
    text = content["/text/trial"]["TextDocument:text"][0][1][0]
    assert f"# cem-1 · trial {trial.trial.number}" in text
    assert f"| moves | {trial.trial.moves} |" in text
    assert f"{trial.trace.grasp_score:.3f}" in text
    assert ("**held**" if trial.trial.success else "**empty**") in text
    assert f"{1e3 * trial.trial.compute_s:.0f} ms per step" in text
    table = content["/text/steps"]["TextDocument:text"][0][1][0]
    assert table.count("\n| ") == len(trial.trace.steps)
    properties = content["/__properties/trial"]
    assert properties["method"][0][1] == ["cem-1"]
    assert properties["final_score"][0][1] == [trial.trace.grasp_score]


def test_the_same_trial_gives_the_same_content(
    content: Content, trial: TrialRecording, heatmaps: list[Heatmap], arm: Ur10Shape, tmp_path: Path
) -> None:
    write_servo_trace(tmp_path / "again.rrd", trial, heatmaps, arm=arm)
    assert read_recording(tmp_path / "again.rrd", timeline=TIMELINE) == content


def test_faults_are_reported_together_and_nothing_is_written(
    trial: TrialRecording, heatmaps: list[Heatmap], tmp_path: Path
) -> None:
    path = tmp_path / "trace.rrd"
    path.write_text("an older recording")
    crooked = dataclasses.replace(heatmaps[0], columns_px=heatmaps[0].columns_px[::-1])
    with pytest.raises(RecordingError, match=r"(?s)2 heatmaps for .* expected one per step; heatmap 1: .* ascending"):
        write_servo_trace(path, trial, [heatmaps[0], crooked])
    with pytest.raises(RecordingError, match="has no steps"):
        write_servo_trace(path, dataclasses.replace(trial, trace=dataclasses.replace(trial.trace, steps=())))
    nameless = dataclasses.replace(trial, station=dataclasses.replace(trial.station, objects=("one",)))
    with pytest.raises(RecordingError, match="catalogue, which has 1"):
        write_servo_trace(path, nameless)
    assert path.read_text() == "an older recording"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(("name", "said"), [(".", "is a folder"), ("missing/trace.rrd", "there is no folder")])
def test_a_path_that_takes_no_file_is_refused(trial: TrialRecording, tmp_path: Path, name: str, said: str) -> None:
    with pytest.raises(VizError, match=said):
        write_servo_trace(tmp_path / name, trial)
    assert list(tmp_path.iterdir()) == []
