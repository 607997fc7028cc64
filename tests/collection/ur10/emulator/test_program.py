"""The handshake in registers, as the uploaded script has it, and what commands do."""

from __future__ import annotations

import numpy as np
import pytest
from tests.support.bare_rig import DONE, READY, SCRIPT, TCP, call, clear, let_pass, lowered, send, start

from handsight.collection.ur10.emulator.machine import Runtime, SafetyMode
from handsight.collection.ur10.emulator.poses import matrix_of, vector_of
from handsight.collection.ur10.emulator.rig import EmulatedRig


def test_command_is_done_once_and_then_waits_to_be_cleared(rig: EmulatedRig) -> None:
    rig.robot.upload(SCRIPT)
    rig.tick(0.0)
    assert (rig.robot.ints_out[0], rig.robot.machine.runtime) == (READY, Runtime.PLAYING)
    send(rig, 17, (1.5, 0.0, 0.0, 0.05))
    assert rig.robot.ints_out[0] == DONE
    rig.robot.doubles_in[0] = 2.5
    let_pass(rig, 0.1)
    assert rig.robot.payload_kg == 1.5  # Still the same command: it is not executed again.
    clear(rig)
    assert rig.robot.ints_out[0] == READY


def test_line_is_straight_and_as_fast_as_asked(rig: EmulatedRig) -> None:
    start(rig)
    before, goal = rig.robot.pose, lowered(rig, 0.1)
    began_s = rig.robot.clock_s
    send(rig, 3, (*goal, 0.1, 0.5), (0,))
    seen = []
    while rig.robot.ints_out[0] != DONE:
        rig.tick(0.0)
        seen.append(rig.robot.pose)
    # 0.1 m at 0.1 m/s, and 0.2 s for each of the ramps of 0.5 m/s2, half of which is the way.
    assert rig.robot.clock_s - began_s == pytest.approx(1.2, abs=0.05)
    assert np.abs(np.array(seen)[:, :2] - before[:2]).max() < 1e-4
    assert rig.robot.pose == pytest.approx(np.array(goal), abs=1e-4)


def test_asynchronous_line_tells_its_progress_and_stops_on_its_way(rig: EmulatedRig) -> None:
    start(rig)
    height_m = rig.robot.pose[2]
    call(rig, 3, (*lowered(rig, 0.2), 0.1, 0.5), (1,))
    assert rig.robot.ints_out[2] & 1 << 15
    let_pass(rig, 0.5)
    call(rig, 33, (5.0,), (0,))
    assert not rig.robot.ints_out[2] & 1 << 15
    assert 0.02 < height_m - rig.robot.pose[2] < 0.06
    there = rig.robot.pose
    let_pass(rig, 0.5)
    assert rig.robot.pose == pytest.approx(there)


def test_velocity_goes_on_until_it_is_stopped(rig: EmulatedRig) -> None:
    start(rig)
    height_m = rig.robot.pose[2]
    send(rig, 10, (0.0, 0.0, -0.05, 0.0, 0.0, 0.0, 0.5, 0.1))
    assert rig.robot.ints_out[0] == READY  # Realtime commands are ready at once.
    clear(rig)
    let_pass(rig, 1.0)  # Far longer than the 0.1 s that it was sent for.
    assert height_m - rig.robot.pose[2] == pytest.approx(0.05, abs=0.005)
    call(rig, 15, (2.0,))
    assert rig.robot.steady


def test_questions_are_answered_in_output_registers(rig: EmulatedRig) -> None:
    start(rig)
    call(rig, 40)
    assert rig.robot.doubles_out[:6] == pytest.approx(TCP)
    for by_m, inside in ((0.1, 1), (0.7, 0), (-3.0, 0)):  # Above the table, below it, out of reach.
        call(rig, 36, lowered(rig, by_m))
        assert rig.robot.ints_out[1] == inside
    call(rig, 47)
    assert rig.robot.ints_out[1] == 1
    there = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
    call(rig, 39, (*TCP, *there))
    assert rig.robot.doubles_out[:6] == pytest.approx(vector_of(matrix_of(TCP) @ matrix_of(there)))


def test_unreachable_pose_stops_protectively_and_ends_the_program(rig: EmulatedRig) -> None:
    start(rig)
    there = rig.robot.pose
    call(rig, 3, (*lowered(rig, -2.0), 0.1, 0.5), (0,))
    assert rig.robot.machine.safety is SafetyMode.PROTECTIVE_STOP
    assert rig.robot.machine.runtime is Runtime.STOPPED
    assert rig.robot.pose == pytest.approx(there)


def test_blow_stops_protectively(rig: EmulatedRig) -> None:
    start(rig)
    call(rig, 3, (*lowered(rig, rig.robot.tip_z_m + 0.1), 0.5, 2.0), (0,))
    assert rig.robot.machine.safety is SafetyMode.PROTECTIVE_STOP
    assert rig.robot.read("safety_status_bits") & 1 << 2


def test_watchdog_ends_a_program_that_is_not_fed(rig: EmulatedRig) -> None:
    start(rig)
    call(rig, 35, (10.0,))
    for _ in range(5):
        let_pass(rig, 0.05)
        rig.robot.feed()
    assert str(rig.robot.machine.runtime) == str(Runtime.PLAYING)
    let_pass(rig, 0.2)
    assert rig.robot.machine.runtime is Runtime.STOPPED


def test_move_until_contact_is_empty_on_a_cb3(cb3: EmulatedRig, e_series: EmulatedRig) -> None:
    moved_m = []
    for rig in (cb3, e_series):
        start(rig)
        call(rig, 3, (*lowered(rig, rig.robot.tip_z_m - 0.02), 0.5, 2.0), (0,))
        height_m = rig.robot.pose[2]
        call(rig, 51, (0.0, 0.0, -0.02, 0.0, 0.0, 0.0, *(0.0,) * 6, 0.5))
        moved_m.append(height_m - rig.robot.pose[2])
    assert moved_m[0] == pytest.approx(0.0)
    assert moved_m[1] == pytest.approx(0.024, abs=0.006)  # To the table, and some millimetres into its spring.


def test_registers_of_the_upper_range_are_those_that_the_script_names(rig: EmulatedRig) -> None:
    rig.robot.upload(SCRIPT.replace("\n0\n", "\n24\n"))
    rig.tick(0.0)
    assert (rig.robot.ints_out[24], rig.robot.ints_out[0]) == (READY, 0)


def test_pose_that_is_no_number_ends_the_program_and_not_the_emulator(rig: EmulatedRig) -> None:
    start(rig)
    call(rig, 3, (float("nan"), *lowered(rig, 0.1)[1:], 0.1, 0.5), (0,))
    assert rig.robot.machine.safety is SafetyMode.PROTECTIVE_STOP
    assert "finite" in rig.robot.events[0][1]


def test_brake_on_a_line_stays_on_the_line(rig: EmulatedRig) -> None:
    start(rig)
    before = rig.robot.pose
    call(rig, 3, (*lowered(rig, 0.2), 0.2, 0.5), (1,))
    let_pass(rig, 0.6)
    call(rig, 34, (3.0,), (0,))
    assert rig.robot.pose[:2] == pytest.approx(before[:2], abs=1e-4)
    assert rig.robot.pose[3:] == pytest.approx(before[3:], abs=1e-3)
