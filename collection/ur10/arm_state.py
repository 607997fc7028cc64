"""What a controller says of its arm."""

from __future__ import annotations

from dataclasses import dataclass

SAFETY_BITS = {2: "protective stop", 4: "safeguard stop", 5: "system emergency stop", 6: "emergency stop",
               7: "emergency stop", 8: "safety violation", 9: "safety fault", 10: "stopped due to safety"}  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmState:
    """What the controller last said."""

    timestamp_s: float
    joints_rad: tuple[float, ...]
    tcp_pose: tuple[float, ...]
    """x y z [m] and rotation vector [rad] in the base frame."""
    speed_m_s: float
    force_n: tuple[float, float, float]
    """On the tool, in base axes."""
    torque_nm: tuple[float, float, float]
    """About the tool, in base axes."""
    temperatures_c: tuple[float, ...]
    runtime: int
    mode: int
    safety_bits: int

    @property
    def stopped_by(self) -> str:
        """What has stopped the arm; empty where nothing has."""
        return next((name for bit, name in sorted(SAFETY_BITS.items()) if self.safety_bits >> bit & 1), "")
