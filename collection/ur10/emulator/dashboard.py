"""The dashboard server, port 29999: lines of text that power the arm, unlock stops and tell states.

Answers are those of the dashboard's documentation and of ``hardware`` notes, letter for letter: clients compare them.
"""

from __future__ import annotations

import asyncio
import re
from collections.abc import Callable

from handsight.collection.ur10.emulator.controller import SERIAL, Controller
from handsight.collection.ur10.emulator.machine import Runtime
from handsight.collection.ur10.emulator.network import Network

PORT = 29999
GREETING = "Connected: Universal Robots Dashboard Server"
TOO_EARLY = (
    "Cannot unlock protective stop until 5s after occurrence. Always inspect cause of protective stop before unlocking"
)
LOCKED = "Command is not allowed due to safety reasons"
PROGRAM = "handsight.urp"

_REMOTE_ONLY = ("play", "power on", "power off", "brake release", "restart safety", "unlock protective stop", "load")
"""What an e-Series controller refuses in local control; reading and stopping is always allowed."""


class Dashboard:
    """Answers to the commands of one controller."""

    def __init__(self, robot: Controller, network: Network) -> None:
        """Serve on the port, once the network opens."""
        self._robot = robot
        self._network = network
        network.serve(PORT, self._connected)
        machine = robot.machine
        self._answers: dict[str, Callable[[], str]] = {
            "polyscopeversion": lambda: robot.generation.dashboard_version,
            "version": lambda: ".".join(map(str, robot.generation.version)),
            "get serial number": lambda: SERIAL,
            "get robot model": lambda: "UR10",
            "robotmode": lambda: f"Robotmode: {machine.mode.name}",
            "safetymode": lambda: f"Safetymode: {machine.safety.name}",
            "safetystatus": lambda: f"Safetystatus: {machine.safety.name}",
            "running": lambda: f"Program running: {str(machine.runtime is Runtime.PLAYING).lower()}",
            "programstate": self._program_state,
            "get loaded program": lambda: f"Loaded program: /programs/{PROGRAM}",
            "isprogramsaved": lambda: f"true {PROGRAM}",
            "play": self._play,
            "pause": self._pause,
            "stop": self._stop,
            "power on": self._power_on,
            "power off": self._power_off,
            "brake release": self._brake_release,
            "unlock protective stop": self._unlock,
            "close safety popup": self._close_popup,
            "close popup": lambda: "closing popup",
            "restart safety": self._restart_safety,
            "clear operational mode": lambda: (
                "No longer controlling the operational mode. Current operational mode: 'AUTOMATIC'."
            ),
            "get operational mode": lambda: "NONE",
        }

    async def _connected(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        def send(text: str) -> None:
            self._network.send(writer, f"{text}\n".encode())

        send(GREETING)
        while line := await reader.readline():
            await self._network.thawed()
            command = line.decode("utf-8", errors="replace").strip()
            if command.lower() in ("quit", "shutdown"):
                send("Disconnected" if command.lower() == "quit" else "Shutting down")
                return
            send(self.answer(command))

    def answer(self, command: str) -> str:
        """The line that answers a command."""
        words = re.sub(r"\s+", " ", command).strip()
        known = words.lower()
        local = self._robot.generation.remote_control and not self._robot.machine.remote
        if known == "is in remote control" and self._robot.generation.remote_control:
            return str(self._robot.machine.remote).lower()
        if local and known.startswith(_REMOTE_ONLY):
            return LOCKED
        if known in self._answers:
            return self._answers[known]()
        if known.startswith("load installation "):
            return f"Loading installation: {words[18:]}"
        if known.startswith("load "):
            return f"Loading program: {words[5:]}"
        if known.startswith("popup "):
            return "showing popup"
        if known.startswith("addtolog "):
            return "Added log message"
        if known.startswith("set operational mode "):
            return f"Operational mode '{words[21:]}' is set"
        return f"could not understand: '{command}'"

    def _program_state(self) -> str:
        names = {Runtime.PLAYING: "PLAYING", Runtime.PAUSED: "PAUSED", Runtime.PAUSING: "PAUSED"}
        return f"{names.get(self._robot.machine.runtime, 'STOPPED')} {PROGRAM}"

    def _play(self) -> str:
        machine = self._robot.machine
        if not machine.may_move or self._robot.program is None:
            return "Failed to execute: play"
        machine.runtime = Runtime.PLAYING
        return "Starting program"

    def _pause(self) -> str:
        machine = self._robot.machine
        if machine.runtime is not Runtime.PLAYING:
            return "Failed to execute: pause"
        machine.runtime = Runtime.PAUSED
        return "Pausing program"

    def _stop(self) -> str:
        self._robot.stop_program()
        return "Stopped"

    def _power_on(self) -> str:
        self._robot.machine.power_on(self._robot.clock_s)
        return "Powering on"

    def _power_off(self) -> str:
        self._robot.stop_program()
        self._robot.machine.power_off()
        return "Powering off"

    def _brake_release(self) -> str:
        self._robot.machine.release_brakes(self._robot.clock_s)
        return "Brake releasing"

    def _unlock(self) -> str:
        if self._robot.machine.too_early(self._robot.clock_s):
            return TOO_EARLY
        self._robot.machine.unlock(self._robot.clock_s)
        return "Protective stop releasing"

    def _close_popup(self) -> str:
        self._robot.machine.popup = ""
        return "closing safety popup"

    def _restart_safety(self) -> str:
        self._robot.stop_program()
        self._robot.machine.restart_safety()
        return "Restarting safety"
