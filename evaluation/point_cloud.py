"""The picture after a step by way of the point cloud, which section III-A sets aside: what it would have been worth.

Every pixel with depth becomes a point, the points are seen from where the step leads, and the nearest one that falls on
a pixel is what it shows. The objects stand right then, where the homography takes all for a plane; but behind them and
beyond the picture there is nothing, and is filled with what is beside it.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from handsight.evaluation.level import before_step, inverse, on_level, pixels_of
from handsight.servoing.planar import PlanarStep
from handsight.servoing.view import View


def predicted_by_points(view: View, step: PlanarStep) -> View:
    """The view after a step at the same height, holes filled from the nearest pixel that something fell on.

    Args:
        view: The picture from which is predicted; some of its depth is valid.
        step: From its pose to the other.
    """
    k = view.camera.intrinsics
    row, column = np.nonzero(view.valid)
    depth_m = view.depth_m[row, column].astype(np.float64)
    places = on_level(view.camera, np.stack([column, row], axis=1).astype(np.float64), depth_m)
    seen_at = np.rint(pixels_of(view.camera, before_step(places, inverse(step)), depth_m)).astype(np.int64)
    inside = ((seen_at >= 0) & (seen_at < (k.width, k.height))).all(axis=1)
    # Far points first: of several on one pixel the nearest is written last, and stays.
    order = np.flatnonzero(inside)[np.argsort(-depth_m[inside], kind="stable")]
    source = np.full((k.height, k.width), -1, np.int64)
    source[seen_at[order, 1], seen_at[order, 0]] = order
    source = _filled(source)
    return View(
        rgb=view.rgb[row[source], column[source]], depth_m=view.depth_m[row[source], column[source]], camera=view.camera
    )


def _filled(source: NDArray[np.int64]) -> NDArray[np.int64]:
    """Entries below 0 replaced by the nearest that is not; all of them by the first point where there is none."""
    known = source >= 0
    if not known.any():
        return np.zeros_like(source)
    _, nearest = cv2.distanceTransformWithLabels(
        (~known).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    of_label = np.zeros(int(nearest.max()) + 1, np.int64)
    of_label[nearest[known]] = source[known]
    filled: NDArray[np.int64] = of_label[nearest]
    return filled
