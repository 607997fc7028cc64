"""What clients read of the emulated controller: its output variables, by name."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from handsight.collection.ur10.emulator.machine import SafetyMode
from handsight.collection.ur10.emulator.poses import tcp_pose, vector_of
from handsight.collection.ur10.emulator.variables import OUTPUTS

if TYPE_CHECKING:
    from handsight.collection.ur10.emulator.controller import Controller

AMBIENT_C = 27.0


def reading(controller: Controller, name: str) -> Any:
    """The value of an output variable; one that is not emulated is zero in its type."""
    if name.startswith("output_int_register_"):
        return controller.ints_out[int(name.rsplit("_", 1)[1])]
    if name.startswith("output_double_register_"):
        return controller.doubles_out[int(name.rsplit("_", 1)[1])]
    found = _READINGS.get(name)
    return _NOTHING[OUTPUTS[name]] if found is None else found(controller)


_NOTHING: dict[str, Any] = {
    "BOOL": False,
    "UINT8": 0,
    "UINT32": 0,
    "UINT64": 0,
    "INT32": 0,
    "DOUBLE": 0.0,
    "VECTOR3D": (0.0,) * 3,
    "VECTOR6D": (0.0,) * 6,
    "VECTOR6INT32": (0,) * 6,
}

_JOINT_RUNNING = 253


def _temperatures(controller: Controller) -> list[float]:
    degrees = AMBIENT_C + 4.0 + controller.heat_c
    if controller.overheated_joint is not None:
        degrees[controller.overheated_joint] = 82.0
    return [float(each) for each in degrees]


_READINGS: dict[str, Any] = {
    "timestamp": lambda c: c.uptime_s,
    "actual_q": lambda c: c.world.joints_rad,
    "target_q": lambda c: c.target_rad,
    "actual_qd": lambda c: c.speed_rad_s,
    "target_qd": lambda c: c.speed_rad_s,
    "actual_TCP_pose": lambda c: c.pose,
    "target_TCP_pose": lambda c: vector_of(tcp_pose(c.target_rad, c.tcp_offset)),
    "actual_TCP_speed": lambda c: c.tool_speed,
    "target_TCP_speed": lambda c: c.tool_speed,
    "actual_TCP_force": lambda c: c.sensor.wrench,
    "ft_raw_wrench": lambda c: c.sensor.wrench,
    "tcp_force_scalar": lambda c: math.sqrt(sum(x * x for x in c.sensor.wrench[:3])),
    "joint_temperatures": _temperatures,
    "joint_mode": lambda c: (_JOINT_RUNNING,) * 6,
    "robot_mode": lambda c: int(c.machine.mode),
    "safety_mode": lambda c: int(c.machine.safety),
    "safety_status": lambda c: int(c.machine.safety),
    "safety_status_bits": lambda c: c.machine.safety_bits,
    "robot_status_bits": lambda c: c.machine.status_bits,
    "runtime_state": lambda c: int(c.machine.runtime),
    "speed_scaling": lambda c: 1.0 if c.machine.safety is not SafetyMode.REDUCED else 0.5,
    "target_speed_fraction": lambda c: 1.0,
    "actual_main_voltage": lambda c: 48.0,
    "actual_robot_voltage": lambda c: 48.0 if c.machine.status_bits & 1 else 0.0,
    "actual_robot_current": lambda c: 0.6,
    "actual_execution_time": lambda c: 0.4,
    "payload": lambda c: c.payload_kg,
    "payload_cog": lambda c: c.payload_cog_m,
    "tcp_offset": lambda c: vector_of(c.tcp_offset),
    "actual_tool_accelerometer": lambda c: (0.0, 0.0, -9.82),
    "tool_temperature": lambda c: AMBIENT_C + 6.0,
    "tool_output_voltage": lambda c: 24,
}
