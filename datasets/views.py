"""A recorded picture as the servoing room sees it."""

from __future__ import annotations

import numpy as np

from handsight.datasets.records import RgbdFrame, StationSpec
from handsight.servoing.view import View


def station_view(frame: RgbdFrame, station: StationSpec) -> View:
    """A recorded picture as the servoing room sees it: depth in metres."""
    depth_m = frame.depth.astype(np.float32) * np.float32(station.depth_scale_m)
    return View(rgb=frame.rgb, depth_m=depth_m, camera=station.camera)
