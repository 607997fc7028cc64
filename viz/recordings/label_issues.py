"""Label issues as a Rerun recording: what was seen and tried, beside what was recorded of it.

Step k of the timeline ``issue`` is the label issue of the k-th lowest quality, from 0. Entities:

    picture/{rgb, depth, jaws, text}    the overhead picture, its depth, the grasp that was attempted, in raw pixels
    input/{rgb, height}                 the network's input for that grasp
    text/issue                          figures, gripper openings, the commands that would mend it
    text/all                            all of them in a table, once
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from handsight.viz import palette
from handsight.viz.errors import RecordingError
from handsight.viz.examples import LabelIssueExample
from handsight.viz.pixels import PictureFrame
from handsight.viz.recordings.encoding import DEPTH_UNIT_M, depth_png, height_image, jpeg, png
from handsight.viz.recordings.glyphs import log_jaws, log_label
from handsight.viz.recordings.layouts import BACKGROUND, input_views
from handsight.viz.recordings.recording import paused_layout, write_recording

KIND = "handsight_label_issues"
TIMELINE = "issue"
JAWS_MARGIN_PX = 12.0
"""Raw pixels shown around jaws that reach over the edge of a picture."""


def write_label_issues(path: Path, examples: Sequence[LabelIssueExample]) -> None:
    """Write label issues, lowest quality first, as a self-contained ``.rrd`` with its layout.

    Raises:
        RecordingError: There is no example, inputs have another shape, or ``path`` cannot be written.
    """
    _check(examples)
    with write_recording(path, kind=KIND, name="label issues", blueprint=_blueprint(examples)) as stream:
        stream.log("text/all", _document(_overview(examples)), static=True)
        for number, example in enumerate(examples):
            stream.set_time(TIMELINE, sequence=number)
            _log_pictures(stream, example)
            stream.log("text/issue", _document(_text(example, f"{number + 1} of {len(examples)}")))


def _check(examples: Sequence[LabelIssueExample]) -> None:
    faults = [] if examples else ["there are no label issues, expected at least one"]
    for example in examples:
        shape = example.inputs.shape
        if len(shape) != 3 or shape[0] != 4 or shape[1] != shape[2]:
            faults.append(f"{example.issue.attempt}: inputs have shape {shape}, expected (4, size, size)")
    if faults:
        raise RecordingError("; ".join(faults))


def _log_pictures(stream: rr.RecordingStream, example: LabelIssueExample) -> None:
    view, issue = example.view, example.issue
    frame = PictureFrame(camera=view.camera, plane_m=view.plane_m)
    stream.log("picture/rgb", jpeg(view.rgb))
    range_m = (view.plane_m - palette.TALLEST_M, view.plane_m + palette.BELOW_TABLE_M)
    stream.log("picture/depth", depth_png(view.depth_m, unit_m=DEPTH_UNIT_M, range_m=range_m))
    colour = palette.HELD if issue.success else palette.EMPTY
    log_jaws(
        stream,
        "picture/jaws",
        frame,
        example.grasp,
        width_m=example.jaws_m,
        colour=colour,
        dashed=not issue.success,
    )
    text = f"labelled {issue.label} · S {issue.predicted_success:.2f}"
    log_label(stream, "picture/text", frame, [example.grasp], text, width_m=example.jaws_m)
    inputs = example.inputs.astype(np.float32)  # (4, size, size)
    stream.log("input/rgb", png(np.rint(255 * inputs[:3].transpose(1, 2, 0)).astype(np.uint8)))
    stream.log("input/height", height_image(inputs[3], top_m=palette.TALLEST_M))


def _text(example: LabelIssueExample, position: str) -> str:
    issue = example.issue
    widths = " → ".join("—" if np.isnan(width_m) else f"{1e3 * width_m:.1f}" for width_m in example.widths_m)
    rows = [
        ("label", f"**{issue.label}**"),
        ("predicted success S", f"{issue.predicted_success:.3f}"),
        ("label quality", f"{issue.label_quality:.3f}"),
        ("target", issue.target or "—"),
        ("gripper before → closed → lifted → final", f"{widths} mm"),
        ("counts as closed", f"at or below {1e3 * example.closed_width_m:.1f} mm"),
    ]
    if issue.truth_held is not None:
        verdict = "disagrees with the label" if issue.truth_disagrees else "agrees with the label"
        rows.append(("simulator", f"{'object held' if issue.truth_held else 'nothing held'}, {verdict}"))
    table = [f"| {name} | {value} |" for name, value in rows]
    # Markdown tables need a head: the first row is one.
    lines = [f"## {position} · {issue.attempt}", "", table[0], "|:--|:--|", *table[1:]]
    for command in example.commands:
        lines += ["", "```", command, "```"]
    return "\n".join(lines) + "\n"


def _overview(examples: Sequence[LabelIssueExample]) -> str:
    lines = ["| step | attempt | label | S | quality | simulator |", "|--:|:--|:--|--:|--:|:--|"]
    for number, example in enumerate(examples):
        issue = example.issue
        values = [f"{issue.predicted_success:.3f}", f"{issue.label_quality:.3f}"]
        cells = [str(number), issue.attempt, issue.label, *values, issue.simulator]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def _document(text: str) -> rr.TextDocument:
    return rr.TextDocument(text, media_type="text/markdown")


def shown_bounds(examples: Sequence[LabelIssueExample]) -> rrb.VisualBounds2D:
    """All of the pictures, and all of the jaws where a grasp was attempted beside its picture."""
    frames = [PictureFrame(camera=one.view.camera, plane_m=one.view.plane_m) for one in examples]
    jaws = [frame.jaws(one.grasp, one.jaws_m) for frame, one in zip(frames, examples, strict=True)]
    jaws_px = np.concatenate([strip for strips in jaws for strip in strips])  # (6 N, 2)
    sizes_px = [(frame.camera.intrinsics.width, frame.camera.intrinsics.height) for frame in frames]
    left_px, top_px = np.minimum(0, jaws_px.min(axis=0) - JAWS_MARGIN_PX).tolist()
    right_px, bottom_px = np.maximum(np.max(sizes_px, axis=0), jaws_px.max(axis=0) + JAWS_MARGIN_PX).tolist()
    return rrb.VisualBounds2D(x_range=(left_px, right_px), y_range=(top_px, bottom_px))


def _blueprint(examples: Sequence[LabelIssueExample]) -> rrb.Blueprint:
    bounds = shown_bounds(examples)

    def picture(name: str, hidden: str) -> rrb.Spatial2DView:
        contents = ["+ $origin/**", f"- /picture/{hidden}"]
        return rrb.Spatial2DView(
            name=name, origin="/picture", contents=contents, background=BACKGROUND, visual_bounds=bounds
        )

    return paused_layout(
        rrb.Vertical(
            rrb.Horizontal(picture("Picture · attempted grasp", "depth"), picture("Depth", "rgb")),
            rrb.Horizontal(
                input_views(max(example.inputs.shape[-1] for example in examples)),
                rrb.Tabs(
                    rrb.TextDocumentView(name="Issue", origin="/text/issue"),
                    rrb.TextDocumentView(name="All", origin="/text/all"),
                    active_tab=0,
                ),
                column_shares=[0.4, 0.6],
            ),
            row_shares=[0.6, 0.4],
        ),
        timeline=TIMELINE,
        fps=1.0,
    )
