"""RTDE packets, byte for byte."""

from __future__ import annotations

import asyncio

import pytest

from handsight.collection.ur10.emulator import wire


def test_packet_is_its_length_its_type_and_its_body() -> None:
    assert wire.packet(wire.REQUEST_PROTOCOL_VERSION, b"\x00\x02") == bytes.fromhex("0005 56 0002".replace(" ", ""))


def test_data_package_has_the_recipe_and_big_endian_values_in_order() -> None:
    recipe = wire.Recipe.of(1, ["timestamp", "runtime_state", "output_int_register_0"], ["DOUBLE", "UINT32", "INT32"])
    packed = recipe.pack({"timestamp": 1.0, "runtime_state": 2, "output_int_register_0": -1})
    assert packed == bytes.fromhex("001455013ff000000000000000000002ffffffff")


def test_vectors_go_there_and_back() -> None:
    recipe = wire.Recipe.of(3, ["actual_q", "joint_mode", "payload_cog"], ["VECTOR6D", "VECTOR6INT32", "VECTOR3D"])
    values = {"actual_q": (1.0, 2.0, 3.0, 4.0, 5.0, 6.0), "joint_mode": (253,) * 6, "payload_cog": (0.0, 0.1, 0.2)}
    assert recipe.unpack(recipe.pack(values)[4:]) == values


def test_pose_of_five_numbers_is_no_data_package() -> None:
    recipe = wire.Recipe.of(1, [f"input_double_register_{n}" for n in range(6)], ["DOUBLE"] * 6)
    with pytest.raises(ValueError, match="48 bytes, got 40"):
        recipe.unpack(bytes(40))


def test_packets_are_read_one_after_the_other() -> None:
    async def both() -> list[tuple[int, bytes]]:
        reader = asyncio.StreamReader()
        reader.feed_data(wire.packet(wire.START) + wire.packet(wire.PAUSE, b"x"))
        return [await wire.read_packet(reader), await wire.read_packet(reader)]

    assert asyncio.run(both()) == [(wire.START, b""), (wire.PAUSE, b"x")]


def test_length_below_a_header_is_refused() -> None:
    async def read() -> None:
        reader = asyncio.StreamReader()
        reader.feed_data(b"\x00\x02V")
        await wire.read_packet(reader)

    with pytest.raises(ValueError, match="2 bytes, expected at least 3"):
        asyncio.run(read())
