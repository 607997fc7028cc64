"""Run by an interpreter that has LeRobot: loads an export, batches it, aggregates its statistics and shows it.

``peer_lerobot.py FOLDER``. Fails where LeRobot does, or where the statistics are not those of what it loads.
"""

from __future__ import annotations

import sys
import tempfile
from importlib.metadata import version
from pathlib import Path

import numpy as np
import torch

if not torch.cuda.is_available():
    # torchvision's default build loads no operators beside a PyTorch without CUDA, and cannot be imported before two of
    # them are declared. LeRobot's datasets use neither.
    for name in ("nms", "qnms"):
        torch.library.define(f"torchvision::{name}", "(Tensor dets, Tensor scores, float iou_threshold) -> Tensor")

from lerobot.datasets.compute_stats import aggregate_stats
from lerobot.datasets.factory import IMAGENET_STATS
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from lerobot.scripts.lerobot_dataset_viz import visualize_dataset


def main(folder: Path) -> None:
    """Check the export in ``folder``."""
    dataset = LeRobotDataset("handsight/export", root=folder)
    batches = list(torch.utils.data.DataLoader(dataset, batch_size=4))
    assert sum(len(batch["index"]) for batch in batches) == len(dataset) > 0
    check_statistics(dataset, batches)
    aggregated = aggregate_stats([dataset.meta.stats, dataset.meta.stats])
    assert aggregated["index"]["count"] == [2 * len(dataset)]
    for key in dataset.meta.camera_keys:
        for measure, values in IMAGENET_STATS.items():  # As its training does.
            assert np.shape(dataset.meta.stats[key][measure])[1:] == np.shape(values)[1:]
    with tempfile.TemporaryDirectory() as shown:
        recording = visualize_dataset(dataset, 0, save=True, output_dir=Path(shown))
        assert recording is not None
        assert recording.stat().st_size > 0
    print(f"lerobot {version('lerobot')}: {len(dataset)} episodes, {', '.join(dataset.meta.camera_keys)}")


def check_statistics(dataset: LeRobotDataset, batches: list[dict[str, torch.Tensor]]) -> None:
    """Every feature has its statistics, and those of pictures are those of the pixels that are loaded."""
    assert dataset.meta.stats.keys() == dataset.features.keys(), dataset.features.keys() - dataset.meta.stats.keys()
    for key in dataset.meta.camera_keys:
        assert all(batch[key].dtype == torch.float32 for batch in batches)
        viewpoint = key.rpartition(".")[2]
        flags = torch.cat(
            [batch.get(f"valid.{viewpoint}", torch.ones(len(batch["index"]))) for batch in batches]
        ).bool()
        pixels = torch.cat([batch[key] for batch in batches])[flags].double()
        found = dataset.meta.stats[key]
        assert found["count"] == [flags.sum()]
        for name, value in {"mean": pixels.mean((0, 2, 3)), "min": pixels.amin((0, 2, 3))}.items():
            np.testing.assert_allclose(found[name].ravel(), value, rtol=1e-5, err_msg=f"{key} {name}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
