"""``handsight view``: its commands, one file for each of them."""

from __future__ import annotations

from handsight.cli.lazy import LazyCommand, LazyGroup, lazy_app

COMMANDS = (
    LazyCommand(
        "dataset",
        "view.dataset:dataset_command",
        "Browse attempts as cards, and decide about them there.",
        (
            "handsight view dataset grasps",
            "handsight view dataset grasps --where \"target == 'cup' and success\" --model runs/rgbd",
            "handsight view dataset grasps --suspect --web",
        ),
        kept="what was decided is committed; thumbnails are kept for the next time",
    ),
    LazyCommand(
        "ablation",
        "view.ablation:ablation_command",
        "Open the page of a sweep, with figure 7.",
        ("handsight view ablation figure7", "handsight view ablation figure7 --no-open --out figure7.html"),
        kept="the page is whole or was not written",
    ),
    LazyCommand(
        "heatmap",
        "view.heatmap:heatmap_command",
        "Look at predicted success over pictures, at all angles.",
        (
            "handsight view heatmap grasps --model runs/rgbd",
            "handsight view heatmap grasps@v1 92 93 --model runs/rgbd --web",
            "handsight view heatmap grasps --model runs/rgbd --wrong --where \"target == 'cup'\"",
        ),
        kept="a recording in --out is whole or was not written",
    ),
    LazyCommand(
        "trace",
        "view.trace:trace_command",
        "Look at a recorded servo run.",
        ("handsight view trace servo.rrd", "handsight view trace servo.rrd --picture step3.png --step 3"),
    ),
)


class ViewGroup(LazyGroup):
    """Everything behind ``handsight view``."""

    table = COMMANDS


view_app = lazy_app(ViewGroup, help="Look at datasets, heatmaps and traces in the Rerun viewer.")
