"""Timing of straight-line and joint motions: trapezoidal speed, sampled at the physics rate."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray


def trapezoid(length: float, *, speed: float, acceleration: float, rate_hz: float) -> NDArray[np.float64]:
    """Path coordinate at every tick of a move from rest to rest; the last value is ``length``. Shape (K,), K >= 1.

    Units are free but must agree: metres, metres/s, metres/s2, or the same in radians.
    """
    peak = min(speed, math.sqrt(max(length, 0.0) * acceleration))
    if peak <= 0:
        return np.array([length])
    ramp_s = peak / acceleration
    total_s = length / peak + ramp_s
    ticks = max(1, math.ceil(total_s * rate_hz))
    t = np.arange(1, ticks + 1) / ticks * total_s  # (K,)
    rising = 0.5 * acceleration * np.minimum(t, ramp_s) ** 2
    cruising = peak * np.clip(t - ramp_s, 0.0, total_s - 2 * ramp_s)
    falling_s = np.clip(t - (total_s - ramp_s), 0.0, ramp_s)
    path: NDArray[np.float64] = rising + cruising + peak * falling_s - 0.5 * acceleration * falling_s**2
    return path


def careful(
    length: float, *, slow_from: float, slow_speed: float, speed: float, acceleration: float, rate_hz: float
) -> NDArray[np.float64]:
    """As :func:`trapezoid`, but from ``slow_from`` along the path on no faster than ``slow_speed``. Shape (K,).

    Units are free but must agree. With ``slow_from`` at ``length`` or beyond nothing is slowed.
    """
    if slow_from >= length or speed <= slow_speed:
        return trapezoid(length, speed=speed, acceleration=acceleration, rate_hz=rate_hz)
    gain, path, at, now = acceleration / rate_hz, [], 0.0, 0.0
    while at < length:
        before = math.sqrt(slow_speed**2 + 2 * acceleration * max(slow_from - at, 0.0))
        # A brake to the end by the same rule would never arrive: its last speed is what one tick can lose.
        stopping = max(gain, math.sqrt(2 * acceleration * (length - at)))
        now = min(now + gain, speed, before, stopping)
        at = min(length, at + now / rate_hz)
        path.append(at)
    return np.array(path)
