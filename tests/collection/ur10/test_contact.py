"""Contact as it is told from the vertical force."""

from __future__ import annotations

from collections.abc import Iterable

import pytest

from handsight.collection.ur10.arm_state import ArmState
from handsight.collection.ur10.contact import ContactWatch


def reading(force_n: float, z_m: float) -> ArmState:
    return ArmState(
        timestamp_s=0.0,
        joints_rad=(0.0,) * 6,
        tcp_pose=(0.7, 0.1, z_m, 0.0, 3.14, 0.0),
        speed_m_s=0.0,
        force_n=(0.0, 0.0, force_n),
        torque_nm=(0.0, 0.0, 0.0),
        temperatures_c=(27.0,) * 6,
        runtime=2,
        mode=7,
        safety_bits=1,
    )


def watched(forces_n: Iterable[float]) -> tuple[ContactWatch, list[bool]]:
    """A watch for two readings in a row of 40 N over 5 N, the n-th taken n mm below the first."""
    watch = ContactWatch(baseline_n=5.0, threshold_n=40.0, samples=2)
    return watch, [watch.seen(reading(force_n, -1e-3 * n)) for n, force_n in enumerate(forces_n)]


def test_contact_is_the_second_reading_in_a_row_over_the_threshold() -> None:
    assert watched([0, 44.9, 45, 20, 45, 60])[1] == [False, False, False, False, False, True]


def test_a_touch_is_where_the_first_of_these_readings_was_taken() -> None:
    watch, _ = watched([5, 70, 5, 46, 50])
    touch = watch.touch(reading(65, -9e-3))
    assert (touch.contact, touch.baseline_n) == (True, 5.0)
    assert touch.force_n == pytest.approx(65.0)
    assert (touch.first_tcp_pose[2], touch.tcp_pose[2]) == (-3e-3, -9e-3)


def test_the_greatest_force_counts_until_the_arm_stands() -> None:
    watch, _ = watched([46, 50])
    assert watch.touch(reading(90, 0.0)).force_n == 85.0


def test_without_contact_there_is_no_force_and_the_arm_stands_where_it_was_sent() -> None:
    watch, seen = watched([5, 70, 5])
    touch = watch.touch(reading(5, -9e-3))
    assert seen == [False] * 3
    assert (touch.contact, touch.force_n) == (False, 0.0)
    assert touch.first_tcp_pose == touch.tcp_pose == (0.7, 0.1, -9e-3, 0.0, 3.14, 0.0)
