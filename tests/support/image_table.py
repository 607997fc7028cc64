"""A folder of pictures with a table, to import."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import cv2
import numpy as np
from tests.support.factories import make_station

from handsight.datasets.format.header import station_to_json


def write_images(folder: Path, count: int) -> None:
    """Pictures and a table, as people have them who wrote their own."""
    rng = np.random.default_rng(0)
    folder.mkdir()
    lines = []
    for number in range(count):
        cv2.imwrite(str(folder / f"{number}.png"), rng.integers(0, 255, (48, 64, 3), dtype=np.uint8))
        cv2.imwrite(str(folder / f"{number}_depth.png"), rng.integers(400, 600, (48, 64), dtype=np.uint16))
        pose = {"overhead_x_m": 0.6, "overhead_y_m": 0.0, "overhead_z_m": 0.5, "overhead_angle_rad": 0.0}
        goal = {"pregrasp_x_m": 0.6, "pregrasp_y_m": 0.0, "pregrasp_angle_rad": 0.1, "grasp_z_m": 0.02}
        pictures = {"overhead_rgb": f"{number}.png", "overhead_depth": f"{number}_depth.png"}
        lines.append({**pictures, **pose, **goal, "width_final_m": 0.03})
    with (folder / "attempts.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=list(lines[0]))
        writer.writeheader()
        writer.writerows(lines)
    station = make_station(width=64, height=48, conditions=(), objects=())
    (folder / "station.json").write_text(json.dumps(station_to_json(station)))
