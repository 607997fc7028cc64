"""Scorer: the network's forward pass and maps of all windows of a picture, on one thread."""

from __future__ import annotations

import torch
from torch import Tensor

from benchmarks import Figure
from benchmarks._network import fresh_network, inference_ms
from handsight.servoing.homography import InputGrid
from handsight.training.scorer import Scorer

SAMPLES = (64, 96, 128)
POSITIONS = ((100, 100), (75, 100))
"""Rows and columns of windows; a picture of 640x480 pixels has about the second."""
STEPS_PX = (1, 2, 4)
BATCH = 256


def run() -> list[Figure]:
    """All figures of the scorer; the weights are those of a fresh network, which take as long as others."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        maps = [_map(rows, columns, every) for rows, columns in POSITIONS for every in STEPS_PX]
        return [*maps, *(_forward(samples) for samples in SAMPLES)]
    finally:
        torch.set_num_threads(threads)


def _inputs(count: int, *shape_px: int) -> Tensor:
    return torch.rand(count, 4, *shape_px, generator=torch.Generator().manual_seed(0))


def _forward(samples: int) -> Figure:
    inputs, network = _inputs(samples, 64, 64), fresh_network()
    folded, bfloat16 = Scorer(network, InputGrid()), Scorer(network, InputGrid(), precision="bfloat16")
    padded = fresh_network(padded=True)
    return Figure(
        name=f"forward pass of {samples} samples",
        ours=inference_ms(lambda: folded(inputs)),
        unit="ms",
        peers={
            "bfloat16": inference_ms(lambda: bfloat16(inputs)),
            "not folded": inference_ms(lambda: torch.sigmoid(network(inputs))),
            "padded, not folded": inference_ms(lambda: torch.sigmoid(padded(inputs))),
        },
        n=samples,
        what=(
            "Scores of inputs (4x64x64) by the default network, its batch norms folded into the convolutions, in "
            "float32; beside it in bfloat16, before folding, and the network with a border of zeros before folding."
        ),
    )


def _map(rows: int, columns: int, every: int) -> Figure:
    size_px = InputGrid().size_px
    (picture,) = _inputs(1, size_px + every * (rows - 1), size_px + every * (columns - 1))
    network = fresh_network()
    scorer, bfloat16 = Scorer(network, InputGrid()), Scorer(network, InputGrid(), precision="bfloat16")
    windows = picture.unfold(1, size_px, every).unfold(2, size_px, every)
    corners = [(row, column) for row in range(rows) for column in range(columns)]

    def one_by_one() -> None:
        for start in range(0, len(corners), BATCH):
            scorer(torch.stack([windows[:, row, column] for row, column in corners[start : start + BATCH]]))

    return Figure(
        name=f"map of {rows}x{columns} windows, every {every} px",
        ours=inference_ms(lambda: scorer.score_map(picture, every=every)),
        unit="ms",
        peers={
            "bfloat16": inference_ms(lambda: bfloat16.score_map(picture, every=every)),
            "window by window": inference_ms(one_by_one, runs=1, warm_up=False),
        },
        n=rows * columns,
        what=f"Scores of all windows of a picture, {every} px apart, by shared convolutions; peer in batches of 256.",
    )
