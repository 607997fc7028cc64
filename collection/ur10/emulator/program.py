"""The program that ``ur_rtde`` uploads, mimicked: the loop that takes commands from registers, not its URScript.

What the loop does with each command is what the uploaded text says, its oddities included: bodies that are empty in the
text for a CB3 are done at once. The commands are in ``motion_commands.py`` and ``query_commands.py``.
"""

from __future__ import annotations

import re
from collections.abc import Generator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from handsight.collection.errors import UnreachableError
from handsight.collection.ur10.emulator.motion import Motion
from handsight.collection.ur10.emulator.motion_commands import MOTION_COMMANDS
from handsight.collection.ur10.emulator.poses import joints_of, matrix_of
from handsight.collection.ur10.emulator.query_commands import QUERY_COMMANDS

if TYPE_CHECKING:
    from handsight.collection.ur10.emulator.controller import Controller

READY, DONE = 1, 2
STOP_SCRIPT = 255
REALTIME = frozenset({6, 9, 10, 11, 24, 25, 26, 27, 38, 58, 66, 67, 68, 69, 70, 71})
EMPTY_ON_CB3 = frozenset({25, 26, 27, 28, 51, 52, 53, 54, 56, 62, 65})
"""Commands whose bodies are stripped from the text that a CB3 gets."""

Steps = Generator[None, None, None]


class Program:
    """One upload of the control script."""

    def __init__(self, controller: Controller, script: str) -> None:
        """Start the loop; registers are those that the script's header names."""
        self.robot = controller
        self.offset = _register_offset(script)
        self._is_control = "rtde_control" in script
        self._executing = False
        self._command: Steps | None = None
        self._watched: Motion | None = None
        self._writes = self._operation = 0
        self.stop_type_line = False
        """Whether an asynchronous stop was asked for once."""
        if self._is_control:
            self._finish_async()
            self.out(0, READY)

    @property
    def blocked(self) -> bool:
        """Whether a command is under way that the loop waits for."""
        return self._command is not None

    # The loop.

    def tick(self) -> None:
        """One turn of the loop."""
        if not self._is_control:
            return
        self._watch_async()
        if self._command is not None:
            self._resume()
            return
        command = self.robot.ints_in[self.offset]
        if command in REALTIME:
            self._run_at_once(command)
            self.out(0, READY)
        elif command == 0:
            self._executing = False
            self.out(0, READY)
        elif not self._executing:
            self._executing = True
            if command == STOP_SCRIPT:
                self.robot.stop_program()
                return
            self._start(command)

    def _resume(self) -> None:
        try:
            if self._command is not None:
                next(self._command)
                return
            self.out(0, DONE)
        except StopIteration:
            self._command = None
            self.out(0, DONE)
        except UnreachableError as error:
            self._command = None
            self.robot.protective_stop(str(error))

    def _start(self, command: int) -> None:
        try:
            self._command = self._begin(command)
        except UnreachableError as error:
            self.robot.protective_stop(str(error))
        else:
            self._resume()

    def _run_at_once(self, command: int) -> None:
        try:
            self._begin(command)
        except UnreachableError as error:
            self.robot.protective_stop(str(error))

    def _begin(self, command: int) -> Steps | None:
        """Start a command; what takes time is returned, what does not is done."""
        if not self.robot.generation.force_sensor and command in EMPTY_ON_CB3:
            return None
        if (move := MOTION_COMMANDS.get(command)) is not None:
            return move(self)
        if (query := QUERY_COMMANDS.get(command)) is not None:
            query(self)
        return None

    # Registers.

    def six(self, start: int = 0) -> NDArray[np.float64]:
        """Six of the numbers that came with the command.

        Raises:
            UnreachableError: They are not finite.
        """
        values = np.array(self.robot.doubles_in[self.offset + start : self.offset + start + 6])
        if not np.isfinite(values).all():
            raise UnreachableError("program", f"registers hold {values.tolist()}, expected finite numbers")
        return values

    def double(self, index: int) -> float:
        """One of the numbers that came with the command."""
        return self.robot.doubles_in[self.offset + index]

    def int_(self, index: int) -> int:
        """One of the whole numbers that came with the command."""
        return self.robot.ints_in[self.offset + index]

    def out(self, index: int, value: int) -> None:
        """Answer with a whole number."""
        self.robot.ints_out[self.offset + index] = value

    def out_six(self, values: NDArray[np.float64]) -> None:
        """Answer with six numbers."""
        self.robot.doubles_out[self.offset : self.offset + 6] = [float(value) for value in values]

    # Asynchronous operations and their status register.

    def _write_async(self, value: int) -> None:
        self._writes = (self._writes + 1) % 128
        if value == 0:
            self._operation = (self._operation + 1) % 128
        running = (min(value, 32767) + 32768) if value >= 0 else 0
        self.out(2, self._writes << 16 | self._operation << 24 | running)

    def start_async(self, motion: Motion) -> None:
        """Begin a motion that the loop does not wait for."""
        self.robot.motion = self._watched = motion
        self._write_async(0)

    def _finish_async(self) -> None:
        self._watched = None
        self._write_async(-1)

    def _watch_async(self) -> None:
        if self._watched is not None and (self._watched.finished or self.robot.motion is not self._watched):
            self._finish_async()

    def stop_async_move(self) -> None:
        """Say that such a motion has ended, if there is one."""
        if self._watched is not None:
            self._finish_async()

    def inverse_of(self, pose: NDArray[np.float64]) -> NDArray[np.float64]:
        """Joints of a tool pose (6,), near those that are commanded now.

        Raises:
            UnreachableError: There are none.
        """
        return joints_of(matrix_of(pose), self.robot.tcp_offset, self.robot.target_rad)


def _register_offset(script: str) -> int:
    """First register that the script uses: 0, or 24 of ``FLAG_UPPER_RANGE_REGISTERS``."""
    found = re.search(r"reg_offset_int\s*=[^\n0-9]*\n?\s*(\d+)", script)
    return int(found[1]) if found else 0
