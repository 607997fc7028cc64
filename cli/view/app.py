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
)


class ViewGroup(LazyGroup):
    """Everything behind ``handsight view``."""

    table = COMMANDS


view_app = lazy_app(ViewGroup, help="Look at datasets, heatmaps and traces in the Rerun viewer.")
