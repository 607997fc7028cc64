"""Pictures that make no view are refused."""

from __future__ import annotations

import numpy as np
import pytest
from tests.support.drawn_table import CAMERA

from handsight.servoing.errors import ImageError
from handsight.servoing.view import View


def test_a_view_without_any_depth_is_refused() -> None:
    k = CAMERA.intrinsics
    rgb = np.zeros((k.height, k.width, 3), np.uint8)
    view = View(rgb=rgb, depth_m=np.zeros((k.height, k.width), np.float32), camera=CAMERA)
    with pytest.raises(ImageError, match="no pixel of the depth picture is valid"):
        _ = view.plane_m


def test_pictures_of_another_size_are_refused() -> None:
    with pytest.raises(ImageError) as caught:
        View(rgb=np.zeros((10, 10, 3), np.uint8), depth_m=np.ones((5, 5), np.float32), camera=CAMERA)
    assert "(10, 10, 3)" in str(caught.value)
    assert "(5, 5)" in str(caught.value)
