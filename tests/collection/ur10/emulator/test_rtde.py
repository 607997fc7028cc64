"""RTDE over a socket, asked by hand: recipes, data, registers that belong to somebody."""

from __future__ import annotations

import socket
import struct
import subprocess
import sys
from collections.abc import Iterator

import pytest
from tests.support.emulated_rig import RunningRig, running_rig

from handsight.collection.ur10.emulator import wire

ANSWER_LIMIT_S = 10


@pytest.fixture(scope="module")
def rig() -> Iterator[RunningRig]:
    with running_rig() as running:
        yield running


class Peer:
    """One client, byte by byte."""

    def __init__(self, rig: RunningRig, port: int = 30004) -> None:
        self.socket = socket.create_connection((rig.robot, port), timeout=ANSWER_LIMIT_S)

    def ask(self, kind: int, body: bytes = b"") -> bytes:
        self.socket.sendall(wire.packet(kind, body))
        while True:
            got, answer = self.packet()
            if got == kind:
                return answer

    def packet(self) -> tuple[int, bytes]:
        length, kind = wire.HEADER.unpack(self.exactly(wire.HEADER.size))
        return kind, self.exactly(length - wire.HEADER.size)

    def exactly(self, count: int) -> bytes:
        data = b""
        while len(data) < count:
            part = self.socket.recv(count - len(data))
            assert part, "the controller hung up"
            data += part
        return data

    def __enter__(self) -> Peer:
        return self

    def __exit__(self, *_: object) -> None:
        self.socket.close()


def outputs(rate_hz: float, names: str) -> bytes:
    return struct.pack(">d", rate_hz) + names.encode()


def test_versions_and_types_are_negotiated(rig: RunningRig) -> None:
    with Peer(rig) as peer:
        assert peer.ask(wire.REQUEST_PROTOCOL_VERSION, b"\x00\x02") == b"\x01"
        assert struct.unpack(">4I", peer.ask(wire.GET_URCONTROL_VERSION))[:2] == (5, 11)
        names = "timestamp,actual_TCP_pose,runtime_state,payload_cog,nonsense,"
        assert peer.ask(wire.SETUP_OUTPUTS, outputs(125, names)) == b"\x01DOUBLE,VECTOR6D,UINT32,VECTOR3D,NOT_FOUND"


def test_readings_stream_from_start_to_pause(rig: RunningRig) -> None:
    with Peer(rig) as peer:
        peer.ask(wire.REQUEST_PROTOCOL_VERSION, b"\x00\x02")
        peer.ask(wire.SETUP_OUTPUTS, outputs(500, "timestamp,safety_status_bits"))
        assert peer.ask(wire.START) == b"\x01"
        seen: list[tuple[float, int]] = []
        while len(seen) < 20:
            kind, body = peer.packet()
            assert (kind, len(body)) == (wire.DATA_PACKAGE, 13)
            recipe, timestamp_s, bits = struct.unpack(">BdI", body)
            assert (recipe, bits) == (1, 1)
            seen.append(timestamp_s)
        assert seen == sorted(set(seen))
        assert peer.ask(wire.PAUSE) == b"\x01"


def test_register_belongs_to_its_first_client_until_it_leaves(rig: RunningRig) -> None:
    with Peer(rig) as first:
        assert first.ask(wire.SETUP_INPUTS, b"input_int_register_0,input_double_register_0,") == b"\x01INT32,DOUBLE"
        assert first.ask(wire.SETUP_INPUTS, b"input_int_register_0,") == b"\x02INT32"
        with Peer(rig) as second:
            assert second.ask(wire.SETUP_INPUTS, b"input_int_register_0,input_int_register_24,") == b"\x00IN_USE,INT32"
            first.socket.close()
            answer = b""
            while answer != b"\x01INT32":
                answer = second.ask(wire.SETUP_INPUTS, b"input_int_register_0,")


def test_primary_port_tells_the_calibrated_kinematics(rig: RunningRig) -> None:
    with Peer(rig, 30001) as peer:
        found: dict[int, bytes] = {}
        while len(found) < 2:
            length, kind = struct.unpack(">iB", peer.exactly(5))
            found[kind] = peer.exactly(length - 5)
        assert b"URControl" in found[20]
        length, kind = struct.unpack_from(">iB", found[16])
        assert (length, kind) == (len(found[16]), 5)
        values = struct.unpack_from(">24d", found[16], 5 + 24)
        assert values[6:12] == pytest.approx((0.0, -0.612, -0.5723, 0.0, 0.0, 0.0))


def test_what_is_not_rtde_is_hung_up_on(rig: RunningRig) -> None:
    with Peer(rig) as peer:
        peer.socket.sendall(b"\x00\x01G")
        assert peer.socket.recv(1) == b""


def test_control_port_refuses_what_makes_no_sense(rig: RunningRig) -> None:
    assert "expected an object with 'do'" in rig.do("dance")["error"]
    assert "slipp" in rig.do("fault", fault="slipp")["error"]
    assert "no objects" in rig.do("refill")["error"]
    assert rig.do("speed", factor=0)["error"].endswith("expected 0.01 to 1000")
    assert rig.do("status")["robot_mode"] == "RUNNING"


def test_address_that_is_taken_is_told(rig: RunningRig) -> None:
    again = subprocess.run(
        [sys.executable, "-m", "handsight.collection.ur10.emulator", "--robot", rig.robot],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert again.returncode == 2
    assert "is another one running there?" in again.stderr


def test_it_ends_when_it_is_told_to() -> None:
    with running_rig() as running:
        assert running.do("stop") == {"stopping": True}
        assert running.process.wait(30) == 0
