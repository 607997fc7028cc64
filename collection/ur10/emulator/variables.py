"""Names and types of what a controller can be asked for and told over RTDE, as its guide lists them."""

from __future__ import annotations

REGISTERS = 48
"""Registers of each kind; the lower half is shared with fieldbus adapters, the upper half is for RTDE clients."""

_VECTOR6D = (
    "target_q target_qd target_qdd target_current target_moment actual_q actual_qd actual_qdd actual_current "
    "actual_moment actual_current_window joint_control_output actual_TCP_pose actual_TCP_speed actual_TCP_force "
    "target_TCP_pose target_TCP_speed joint_temperatures actual_joint_voltage ft_raw_wrench tcp_offset"
)
_DOUBLE = (
    "timestamp actual_execution_time speed_scaling target_speed_fraction actual_momentum actual_main_voltage "
    "actual_robot_voltage actual_robot_current standard_analog_input0 standard_analog_input1 standard_analog_output0 "
    "standard_analog_output1 io_current tool_analog_input0 tool_analog_input1 tool_output_current tool_temperature "
    "tcp_force_scalar payload collision_detection_ratio wrench_calc_from_currents"
)
_VECTOR3D = "actual_tool_accelerometer elbow_position elbow_velocity payload_cog"
_UINT32 = (
    "robot_status_bits safety_status_bits analog_io_types runtime_state tool_analog_input_types script_control_line"
)
_INT32 = "robot_mode safety_mode safety_status tool_output_voltage"
_UINT64 = "actual_digital_input_bits actual_digital_output_bits"

NEWER = {"ft_raw_wrench": (5, 9), "payload": (3, 11), "payload_cog": (3, 11), "actual_qdd": (5, 23)}
"""Variables that only controllers from some version on know."""

OUTPUTS: dict[str, str] = {
    **dict.fromkeys(_VECTOR6D.split(), "VECTOR6D"),
    **dict.fromkeys(_DOUBLE.split(), "DOUBLE"),
    **dict.fromkeys(_VECTOR3D.split(), "VECTOR3D"),
    **dict.fromkeys(_UINT32.split(), "UINT32"),
    **dict.fromkeys(_INT32.split(), "INT32"),
    **dict.fromkeys(_UINT64.split(), "UINT64"),
    "joint_mode": "VECTOR6INT32",
    "tool_mode": "UINT32",
    "payload_inertia": "VECTOR6D",
    "output_bit_registers0_to_31": "UINT32",
    "output_bit_registers32_to_63": "UINT32",
    **{f"output_int_register_{n}": "INT32" for n in range(REGISTERS)},
    **{f"output_double_register_{n}": "DOUBLE" for n in range(REGISTERS)},
    **{f"output_bit_register_{n}": "BOOL" for n in range(64, 128)},
}

INPUTS: dict[str, str] = {
    "speed_slider_mask": "UINT32",
    "speed_slider_fraction": "DOUBLE",
    "standard_digital_output_mask": "UINT8",
    "standard_digital_output": "UINT8",
    "configurable_digital_output_mask": "UINT8",
    "configurable_digital_output": "UINT8",
    "tool_digital_output_mask": "UINT8",
    "tool_digital_output": "UINT8",
    "standard_analog_output_mask": "UINT8",
    "standard_analog_output_type": "UINT8",
    "standard_analog_output_0": "DOUBLE",
    "standard_analog_output_1": "DOUBLE",
    "external_force_torque": "VECTOR6D",
    "input_bit_registers0_to_31": "UINT32",
    "input_bit_registers32_to_63": "UINT32",
    **{f"input_int_register_{n}": "INT32" for n in range(REGISTERS)},
    **{f"input_double_register_{n}": "DOUBLE" for n in range(REGISTERS)},
    **{f"input_bit_register_{n}": "BOOL" for n in range(64, 128)},
}


def output_type(name: str, version: tuple[int, ...]) -> str | None:
    """Type of an output of a controller of some PolyScope version; None where it has none of that name."""
    return None if version[:2] < NEWER.get(name, (0, 0)) else OUTPUTS.get(name)
