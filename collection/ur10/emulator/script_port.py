"""Port 30003, on which scripts are uploaded, and port 30001, which tells who the arm is.

A script ends with its last ``end`` in the first column. The primary interface sends its version message and, once, the
kinematics of the arm (package type 5 of a robot state), as long as a client is interested in no more.
"""

from __future__ import annotations

import asyncio
import re
import struct

from handsight.collection.ur10.emulator.controller import Controller
from handsight.collection.ur10.emulator.network import Network

SCRIPT_PORT = 30003
PRIMARY_PORT = 30001
SECONDARY_PORT = 30002
MOST_SCRIPT = 1 << 20

ROBOT_STATE, ROBOT_MESSAGE = 16, 20
KINEMATICS_INFO = 5
VERSION_MESSAGE = 3
DH_THETA_RAD = (0.0,) * 6
DH_A_M = (0.0, -0.612, -0.5723, 0.0, 0.0, 0.0)
DH_D_M = (0.1273, 0.0, 0.0, 0.163941, 0.1157, 0.0922)
DH_ALPHA_RAD = (1.570796327, 0.0, 0.0, 1.570796327, -1.570796327, 0.0)

_WHOLE = re.compile(rb"\A\s*(?:def|sec)\s.*?^end[ \t]*\r?\n", re.DOTALL | re.MULTILINE)
"""A program, from its definition to the first ``end`` that is not indented."""


class ScriptPort:
    """Uploads to one controller."""

    def __init__(self, robot: Controller, network: Network) -> None:
        """Serve on the ports, once the network opens."""
        self._robot = robot
        self._network = network
        network.serve(SCRIPT_PORT, self._scripts)
        network.serve(PRIMARY_PORT, self._primary)
        network.serve(SECONDARY_PORT, self._primary)

    async def _scripts(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        del writer
        received = b""
        while part := await reader.read(65536):
            await self._network.thawed()
            received += part
            while found := _WHOLE.match(received):
                self._robot.upload(found[0].decode("utf-8", errors="replace"))
                received = received[found.end() :]
            if len(received) > MOST_SCRIPT:
                return

    async def _primary(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._network.send(writer, version_message(self._robot) + kinematics_message(self._robot))
        await self._scripts(reader, writer)


def version_message(robot: Controller) -> bytes:
    """The first message of the primary interface: project, version, build date."""
    major, minor, bugfix, build = robot.generation.version
    project, date = b"URControl", robot.generation.released.encode()
    body = struct.pack(">QbBB", round(1e6 * robot.clock_s), -2, VERSION_MESSAGE, len(project)) + project
    body += struct.pack(">BBii", major, minor, bugfix, build) + date
    return struct.pack(">iB", 5 + len(body), ROBOT_MESSAGE) + body


def kinematics_message(robot: Controller) -> bytes:
    """A robot state that holds the calibrated kinematics alone."""
    checksums = [(robot.kinematics_checksum + joint) & 0xFFFFFFFF for joint in range(6)]
    body = struct.pack(">6I", *checksums)
    body += struct.pack(">24d", *DH_THETA_RAD, *DH_A_M, *DH_D_M, *DH_ALPHA_RAD) + struct.pack(">I", 1)
    package = struct.pack(">iB", 5 + len(body), KINEMATICS_INFO) + body
    return struct.pack(">iB", 5 + len(package), ROBOT_STATE) + package
