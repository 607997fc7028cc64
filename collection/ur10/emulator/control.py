"""The control port: what a person at the rig sees and does, one line of JSON in and one out.

``{"do": "status"}`` tells clock, states, phase and what has gone wrong; ``scene`` where objects are; ``fault`` with
``"fault": "protective-stop@descend"`` lets something go wrong (``faults.py``), ``clear`` undoes it; ``release`` turns
the emergency button back and leaves the safeguarded cell; ``refill`` puts lost objects back, with ``"everything":
true`` drops all anew, with ``"exchange": true`` others of the set; ``empty`` takes all off the table; both leave what
the jaws hold, unless ``"held": true``. ``put`` with ``object``, ``position_m`` and ``angle_rad`` places one; ``board``
with the values of ``Board`` lays a calibration target, with ``"gone": true`` takes it away; ``camera-power-cycle``
switches its USB port; ``remote`` with ``"on"`` turns the key; ``speed`` with ``factor`` changes the clock; ``stop``
ends the emulator.
What makes no sense is answered with ``{"error": ...}``.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from dataclasses import asdict
from typing import Any

from handsight.collection.sim.kinematics import flange_pose
from handsight.collection.ur10.emulator.board import Board
from handsight.collection.ur10.emulator.errors import EmulatorError
from handsight.collection.ur10.emulator.faults import Fault
from handsight.collection.ur10.emulator.network import Network
from handsight.collection.ur10.emulator.physics import PhysicalWorld
from handsight.collection.ur10.emulator.poses import vector_of
from handsight.collection.ur10.emulator.rig import EmulatedRig

Values = dict[str, Any]


class Control:
    """The control port of one rig."""

    def __init__(self, rig: EmulatedRig, address: str, port: int, stop: Callable[[], None]) -> None:
        """Serve once its network opens: one of its own, which no fault touches."""
        self._rig = rig
        self._stop = stop
        self.network = Network(address)
        self.network.serve(port, self._connected)
        self._actions: dict[str, Callable[[Values], Values]] = {
            "status": self._status,
            "scene": self._scene,
            "fault": self._fault,
            "clear": self._clear,
            "release": self._release,
            "refill": self._refill,
            "empty": self._empty,
            "put": self._put,
            "board": self._board,
            "remote": self._remote,
            "speed": self._speed,
            "camera-power-cycle": self._power_cycle,
            "stop": self._end,
        }

    async def _connected(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        while line := await reader.readline():
            writer.write(json.dumps(self.answer(line.decode("utf-8", errors="replace"))).encode() + b"\n")
            await writer.drain()

    def answer(self, line: str) -> Values:
        """The answer to one line."""
        try:
            request = json.loads(line)
            if not isinstance(request, dict) or request.get("do") not in self._actions:
                return {"error": f"expected an object with 'do', one of {', '.join(self._actions)}; got {line.strip()}"}
            return self._actions[request.pop("do")](request)
        except (ValueError, TypeError, KeyError, IndexError) as error:
            return {"error": f"{type(error).__name__}: {error}"}

    def _status(self, _: Values) -> Values:
        rig = self._rig
        machine = rig.robot.machine
        return {
            "clock_s": rig.robot.clock_s,
            "factor": rig.clock.factor,
            "phase": rig.faults.phase(),
            "robot_mode": machine.mode.name,
            "safety": machine.safety.name,
            "runtime": machine.runtime.name,
            "remote": machine.remote,
            "popup": machine.popup,
            "protective_stops": rig.robot.events,
            "tcp_pose": [float(value) for value in rig.robot.pose],
            "flange_pose": [float(value) for value in vector_of(flange_pose(rig.world.joints_rad))],
            "tip_z_m": rig.robot.tip_z_m,
            "moving": rig.robot.moving,
            "travelled_m": [
                [float(value) for value in end] for end in (rig.robot.travel.low_m, rig.robot.travel.high_m)
            ],
            "force_n": rig.robot.sensor.wrench[:3],
            "gripper": {name: rig.gripper.get(name) for name in ("POS", "OBJ", "STA", "FLT")},
            "width_m": rig.world.width_m,
            "rtde_clients": rig.rtde.clients,
            "armed": [fault.name for fault in rig.faults.armed],
            "fired": [asdict(fired) for fired in rig.faults.fired],
        }

    def _world(self) -> PhysicalWorld:
        if not isinstance(self._rig.world, PhysicalWorld):
            raise EmulatorError("this rig has no objects: start the emulator with --objects SET")
        return self._rig.world

    def _scene(self, _: Values) -> Values:
        world = self._world()
        held, lost = world.held(), world.lost()
        return {
            "objects": [
                {"id": name, "pose": [float(value) for value in pose], "held": body in held, "lost": body in lost}
                for name, body, pose in zip(world.object_ids, world.scene.bodies, world.scene.poses(), strict=True)
            ]
        }

    def _fault(self, values: Values) -> Values:
        fault = Fault.parse(values["fault"])
        self._rig.faults.arm(fault)
        return {"armed": fault.name, "when": fault.when or "now"}

    def _clear(self, _: Values) -> Values:
        self._rig.faults.clear()
        return {"cleared": True}

    def _release(self, _: Values) -> Values:
        self._rig.robot.machine.release()
        return {"safety": self._rig.robot.machine.safety.name}

    def _refill(self, values: Values) -> Values:
        if values.get("exchange", False):
            return {"put_back": self._world().exchange(held_too=bool(values.get("held", False)))}
        return {"put_back": self._world().refill(everything=bool(values.get("everything", False)))}

    def _empty(self, values: Values) -> Values:
        return {"taken_away": self._world().clear(held_too=bool(values.get("held", False)))}

    def _put(self, values: Values) -> Values:
        world = self._world()
        x_m, y_m, z_m = (float(value) for value in values["position_m"])
        world.put(int(values["object"]), (x_m, y_m, z_m), float(values.get("angle_rad", 0.0)))
        return {"put": world.object_ids[int(values["object"])]}

    def _board(self, values: Values) -> Values:
        if self._rig.camera is None:
            raise EmulatorError("this rig has no camera: start the emulator with --camera")
        self._rig.camera.board = None if values.pop("gone", False) else Board(**values)
        return {"board": self._rig.camera.board is not None}

    def _remote(self, values: Values) -> Values:
        self._rig.robot.machine.remote = bool(values["on"])
        return {"remote": self._rig.robot.machine.remote}

    def _speed(self, values: Values) -> Values:
        factor = float(values["factor"])
        if not 0.01 <= factor <= 1000:
            raise EmulatorError(f"factor is {factor}, expected 0.01 to 1000")
        self._rig.clock.factor = factor
        return {"factor": factor}

    def _power_cycle(self, _: Values) -> Values:
        if self._rig.camera is None:
            raise EmulatorError("this rig has no camera: start the emulator with --camera")
        self._rig.network.keep(self._rig.camera.power_cycle())
        return {"power_cycled": True}

    def _end(self, _: Values) -> Values:
        self._stop()
        return {"stopping": True}
