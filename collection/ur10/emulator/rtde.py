"""The RTDE server, port 30004: recipes are negotiated once, then readings stream and registers are written.

An input variable belongs to the client whose recipe named it first, until it leaves; others are told ``IN_USE``.
"""

from __future__ import annotations

import asyncio
import struct
from dataclasses import dataclass, field

from handsight.collection.ur10.emulator import wire
from handsight.collection.ur10.emulator.controller import Controller
from handsight.collection.ur10.emulator.network import Network
from handsight.collection.ur10.emulator.variables import INPUTS, output_type

PORT = 30004
YES, NO = b"\x01", b"\x00"


@dataclass(slots=True, eq=False)
class Client:
    """One connection."""

    writer: asyncio.StreamWriter
    outputs: wire.Recipe | None = None
    inputs: dict[int, wire.Recipe] = field(default_factory=dict)
    owned: set[str] = field(default_factory=set)
    streaming: bool = False
    every_s: float = 0.0
    """Between two data packages, in the client's time."""
    next_s: float = 0.0


class RtdeServer:
    """All RTDE clients of one controller."""

    def __init__(self, robot: Controller, network: Network) -> None:
        """Serve on the port, once the network opens."""
        self._robot = robot
        self._network = network
        self._clients: set[Client] = set()
        self.taken: set[str] = set()
        """Input variables that something else writes, as a fieldbus adapter does."""
        network.serve(PORT, self._connected)

    @property
    def clients(self) -> int:
        """How many are connected."""
        return len(self._clients)

    def stream(self, now_s: float) -> None:
        """Send each client that is due at ``now_s``, of the wall's clock, the readings of this period."""
        for client in self._clients:
            if client.streaming and client.outputs is not None and now_s >= client.next_s:
                # Late by more than one package, what was missed is left out.
                client.next_s = max(client.next_s + client.every_s, now_s - client.every_s)
                values = {name: self._robot.read(name) for name in client.outputs.names}
                self._network.send(client.writer, client.outputs.pack(values))

    async def _connected(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        client = Client(writer)
        self._clients.add(client)
        try:
            while True:
                kind, body = await wire.read_packet(reader)
                await self._network.thawed()
                self._handle(client, kind, body)
        except (ValueError, struct.error):
            return  # Not RTDE: the controller hangs up.
        finally:
            self._clients.discard(client)

    def _handle(self, client: Client, kind: int, body: bytes) -> None:
        if kind == wire.DATA_PACKAGE:
            self._receive(client, body)
        elif kind == wire.REQUEST_PROTOCOL_VERSION:
            (wanted,) = struct.unpack(">H", body)
            self._reply(client, kind, YES if wanted == wire.PROTOCOL_VERSION else NO)
        elif kind == wire.GET_URCONTROL_VERSION:
            self._reply(client, kind, struct.pack(">4I", *self._robot.generation.version))
        elif kind == wire.SETUP_OUTPUTS:
            self._reply(client, kind, self._set_up_outputs(client, body))
        elif kind == wire.SETUP_INPUTS:
            self._reply(client, kind, self._set_up_inputs(client, body))
        elif kind == wire.START:
            client.streaming = client.outputs is not None
            self._reply(client, kind, YES if client.streaming else NO)
        elif kind == wire.PAUSE:
            client.streaming = False
            self._reply(client, kind, YES)

    def _reply(self, client: Client, kind: int, body: bytes) -> None:
        self._network.send(client.writer, wire.packet(kind, body))

    def _set_up_outputs(self, client: Client, body: bytes) -> bytes:
        (rate_hz,) = struct.unpack_from(">d", body)
        names = _names(body[8:])
        types = [output_type(name, self._robot.generation.version) for name in names]
        if all(types) and names:
            client.outputs = wire.Recipe.of(1, names, [kind for kind in types if kind])
            client.every_s = 1.0 / min(max(rate_hz, 1.0), self._robot.generation.control_hz)
        return b"\x01" + ",".join(kind or wire.NOT_FOUND for kind in types).encode()

    def _set_up_inputs(self, client: Client, body: bytes) -> bytes:
        names = _names(body)
        others = {name for other in self._clients if other is not client for name in other.owned} | self.taken
        types = [wire.IN_USE if name in others else INPUTS.get(name, wire.NOT_FOUND) for name in names]
        if any(kind in (wire.IN_USE, wire.NOT_FOUND) for kind in types):
            return NO + ",".join(types).encode()
        number = len(client.inputs) + 1
        client.inputs[number] = wire.Recipe.of(number, names, types)
        client.owned.update(names)
        return bytes([number]) + ",".join(types).encode()

    def _receive(self, client: Client, body: bytes) -> None:
        recipe = client.inputs.get(body[0]) if body else None
        if recipe is None:
            return
        for name, value in recipe.unpack(body[1:]).items():
            if name.startswith("input_int_register_"):
                self._robot.ints_in[int(name.rsplit("_", 1)[1])] = value
            elif name.startswith("input_double_register_"):
                self._robot.doubles_in[int(name.rsplit("_", 1)[1])] = value
            else:
                self._robot.inputs[name] = value
        if "input_int_register_0" in recipe.names or "input_int_register_24" in recipe.names:
            self._robot.feed()


def _names(listed: bytes) -> list[str]:
    """Names in a comma list, which ``ur_rtde`` ends with a comma."""
    return [name for name in listed.decode("ascii", errors="replace").split(",") if name.strip()]
