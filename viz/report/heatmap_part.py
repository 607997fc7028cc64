"""What a report tells of heatmaps: predicted success over recorded pictures, and where the network was wrong."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from handsight.datasets.errors import counted
from handsight.evaluation.foresight import Foresight
from handsight.viz.examples import ForesightOverview, HeatmapExample
from handsight.viz.figures.montage import montage_figure
from handsight.viz.report.content import Block, Figure, Gallery, Note, Section
from handsight.viz.report.embedding import embedded_png, embedded_rgb

COLUMNS = 4
WIDTH_PX = 400


def heatmap_section(
    examples: Sequence[HeatmapExample], overview: ForesightOverview | None, *, address: str, run: Path
) -> Section:
    """The heatmaps of some attempts, and pictures of those about which the network is most wrong.

    Args:
        examples: At least one; the first four are drawn.
        overview: Predicted against happened; None where nothing was compared.
        address: The version that the attempts are of, as a command names it.
        run: Folder of the network.
    """
    shown = examples[:COLUMNS]
    command = f"handsight heatmap {shlex.quote(address)} --model {shlex.quote(str(run))}"
    told = "; ".join(f"{one.title}, best score {float(np.max(one.heatmap.scores)):.2f}" for one in shown)
    blocks: list[Block] = [
        Figure(
            picture=embedded_png(lambda path: montage_figure(path, shown)),
            alt=f"Overhead pictures with the best grasp, predicted success over them, and depth: {told}.",
            caption=(
                "Above what the camera saw, with the best grasp; in the middle predicted success S; below depth, as "
                "height above the table (figure 8 of the paper)."
            ),
            command=f"{command} --wrong -n {len(examples)} --picture heatmaps.png",
        )
    ]
    if overview is None or not overview.wrong:
        blocks.append(Note(text="No attempt has a label to compare predictions with."))
    else:
        blocks.append(_wrong(overview, command, f"--wrong -n {len(examples)}"))
    return Section(title=f"Heatmaps of {run}", blocks=tuple(blocks))


def _wrong(overview: ForesightOverview, command: str, chosen: str) -> Gallery:
    learnt = "" if not overview.learnt else f" The network learnt from {overview.learnt} of them."
    return Gallery(
        title="Where the network is most wrong",
        text=(
            f"Of {counted(overview.attempts, 'attempt')} that were compared, those of which happened what the network "
            f"expected least.{learnt} The mark is the pair of open jaws of the grasp that was tried: blue and whole "
            "where it held, orange and dashed where it failed."
        ),
        pictures=tuple(
            Figure(
                picture=embedded_rgb(picture, width_px=WIDTH_PX),
                alt=f"Overhead picture with the grasp that was tried, which {_happened(one)}.",
                caption=f"{one.attempt}: predicted {one.score:.2f}, {_happened(one)}.",
                command=f"{command} {one.attempt} --picture attempt.png",
            )
            for one, picture in zip(overview.wrong, overview.thumbnails, strict=False)
        ),
        command=f"{command} {chosen}",
    )


def _happened(one: Foresight) -> str:
    return "held" if one.held else "failed"
