"""Grasps in the emulated rig succeed or fail by physics."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from tests.support.bare_rig import let_pass, robotiq

from handsight.collection.sim.config import SimConfig
from handsight.collection.ur10.emulator.faults import Fault
from handsight.collection.ur10.emulator.generation import E_SERIES
from handsight.collection.ur10.emulator.motion import line_path
from handsight.collection.ur10.emulator.physics import JAWS_REST_M_S, PhysicalWorld
from handsight.collection.ur10.emulator.poses import matrix_of
from handsight.collection.ur10.emulator.rig import EmulatedRig, RigSettings
from handsight.servoing.planar import PlanarPose

BLOCK_XY_M = (0.65, 0.02)
GRASP_Z_M = 0.01
AT_REST_S = 1.0


@pytest.fixture
def world() -> Iterator[PhysicalWorld]:
    """One block, the same every time, at a known place."""
    world = PhysicalWorld(SimConfig(objects="blocks-test", objects_per_scene=1), seed=1)
    world.put(0, (*BLOCK_XY_M, 0.05))
    yield world
    world.close()


@pytest.fixture
def rig(world: PhysicalWorld) -> EmulatedRig:
    rig = EmulatedRig(RigSettings(robot="127.0.0.2", generation=E_SERIES), world)
    rig.robot.set_tcp(np.array([0.0, 0.0, 0.16, 0.0, 0.0, 0.0]))
    rig.robot.payload_kg = 1.3
    robotiq(rig).answer("SET ACT 1")
    let_pass(rig, 3.0)
    return rig


def line(rig: EmulatedRig, x_m: float, y_m: float, z_m: float, *, speed_m_s: float = 0.25) -> None:
    goal = PlanarPose(x_m=x_m, y_m=y_m, angle_rad=0.0).pose_base_tool(z_m)
    robot = rig.robot
    robot.motion = motion = line_path(
        robot.target_rad, goal, speed=speed_m_s, acceleration=1.0, tcp_offset=robot.tcp_offset
    )
    while robot.motion is motion:
        rig.tick(0.0)


def jaws(rig: EmulatedRig, position: int) -> tuple[int, int]:
    robotiq(rig).answer(f"SET POS {position} SPE 255 FOR 50 GTO 1")
    let_pass(rig, AT_REST_S)
    return rig.gripper.get("POS"), rig.gripper.get("OBJ")


def grasp(rig: EmulatedRig, x_m: float, y_m: float) -> tuple[int, int]:
    """The cycle from above; the gripper's readings after the lift."""
    line(rig, x_m, y_m, 0.2)
    line(rig, x_m, y_m, GRASP_Z_M, speed_m_s=0.1)
    jaws(rig, 255)
    line(rig, x_m, y_m, 0.25)
    let_pass(rig, AT_REST_S)
    return rig.gripper.get("POS"), rig.gripper.get("OBJ")


def block_xy_m(world: PhysicalWorld) -> tuple[float, float]:
    x_m, y_m = (float(value) for value in world.scene.poses()[0, :2])
    return x_m, y_m


def test_block_is_lifted_weighs_and_falls_back(rig: EmulatedRig, world: PhysicalWorld) -> None:
    empty_n = rig.robot.sensor.contact_n[2]
    position, obj = grasp(rig, *block_xy_m(world))
    assert position < 220
    assert obj == 2
    assert world.held() == world.scene.bodies
    mass_kg = world.bullet.getDynamicsInfo(world.scene.bodies[0], -1)[0]
    assert rig.robot.sensor.contact_n[2] - empty_n == pytest.approx(-9.81 * mass_kg, rel=0.05)
    line(rig, 0.62, -0.05, 0.1)
    assert jaws(rig, 0) == (0, 3)
    let_pass(rig, AT_REST_S)
    assert world.held() == []
    assert block_xy_m(world) == pytest.approx((0.62, -0.05), abs=0.05)


def test_grasp_beside_the_block_closes_on_nothing(rig: EmulatedRig, world: PhysicalWorld) -> None:
    x_m, y_m = block_xy_m(world)
    assert grasp(rig, x_m, y_m + 0.12) == (228, 3)
    assert world.held() == []


def test_jaws_that_press_on_something_stand(rig: EmulatedRig, world: PhysicalWorld) -> None:
    # Bullet has joints under load tremble at a tenth of a metre in a second, and get nowhere.
    jaws(rig, 255)
    for _ in range(round(AT_REST_S / rig.robot.period_s)):
        rig.tick(0.0)
        assert world.jaw_speed_m_s < JAWS_REST_M_S


@pytest.mark.parametrize("speed", [0, 255])
def test_jaws_are_not_taken_for_stopped_while_they_close(rig: EmulatedRig, world: PhysicalWorld, speed: int) -> None:
    robotiq(rig).answer(f"SET POS 255 SPE {speed} FOR 50 GTO 1")
    while rig.gripper.get("OBJ") == 0:
        rig.tick(0.0)
    assert (rig.gripper.get("POS"), rig.gripper.get("OBJ")) == (228, 3)


def test_block_that_slips_is_read_as_lost(rig: EmulatedRig, world: PhysicalWorld) -> None:
    grasp(rig, *block_xy_m(world))
    assert world.slip()
    let_pass(rig, 2.0)
    assert (rig.gripper.get("POS"), rig.gripper.get("OBJ")) == (228, 3)
    assert world.held() == []


def test_slip_waits_until_there_is_something_to_lose(rig: EmulatedRig, world: PhysicalWorld) -> None:
    rig.faults.arm(Fault.parse("slip@lift"))
    x_m, y_m = block_xy_m(world)
    assert grasp(rig, x_m, y_m + 0.12) == (228, 3)
    assert rig.faults.fired == []
    jaws(rig, 0)
    assert grasp(rig, *block_xy_m(world)) == (228, 3)
    assert [(fired.name, fired.phase) for fired in rig.faults.fired] == [("slip", "lift")]


def test_descent_onto_a_block_is_felt(rig: EmulatedRig, world: PhysicalWorld) -> None:
    # One finger above the block: it cannot pass.
    x_m, y_m = block_xy_m(world)
    highest_n = 0.0
    goal = PlanarPose(x_m=x_m + 0.0475, y_m=y_m, angle_rad=0.0).pose_base_tool(GRASP_Z_M)
    line(rig, x_m + 0.0475, y_m, 0.2)
    robot = rig.robot
    robot.motion = motion = line_path(robot.target_rad, goal, speed=0.05, acceleration=1.0, tcp_offset=robot.tcp_offset)
    while robot.motion is motion:
        rig.tick(0.0)
        highest_n = max(highest_n, float(robot.sensor.contact_n[2]))
        if highest_n > 40:
            motion.brake(1.0, joints=False)
    assert 40 < highest_n < 90
    assert robot.pose[2] > GRASP_Z_M + 0.005
    assert robot.events == []


def test_what_left_the_table_is_put_back_on_request(rig: EmulatedRig, world: PhysicalWorld) -> None:
    world.put(0, (0.65, 0.6, 0.05))
    let_pass(rig, 2.0)
    assert world.lost() == world.scene.bodies
    assert world.refill() == 1
    let_pass(rig, 3.0)
    assert world.lost() == []
    assert world.refill() == 0


def test_objects_are_exchanged_for_others_of_the_set(rig: EmulatedRig, world: PhysicalWorld) -> None:
    before = world.object_ids
    assert world.exchange() == 1
    let_pass(rig, 3.0)
    assert world.object_ids != before
    assert len(world.scene.poses()) == 1
    assert world.scene.poses()[0, 2] < 0.1  # It has come down.


def test_what_hangs_on_the_jaws_is_exchanged_on_request_alone(rig: EmulatedRig, world: PhysicalWorld) -> None:
    grasp(rig, *block_xy_m(world))
    assert world.held() == world.scene.bodies
    assert world.exchange() == 0
    assert world.exchange(held_too=True) == 1
    let_pass(rig, 3.0)
    assert world.held() == []
    assert len(world.scene.bodies) == 1


def test_table_is_emptied_and_filled_again(rig: EmulatedRig, world: PhysicalWorld) -> None:
    assert world.clear() == 1
    let_pass(rig, 1.0)
    assert (world.object_ids, world.scene.bodies, world.held(), world.lost()) == ([], [], [], [])
    assert world.exchange() == 1
    let_pass(rig, 3.0)
    assert len(world.scene.poses()) == 1


@pytest.mark.parametrize("way", ["refill", "exchange"])
def test_nothing_is_dropped_onto_the_arm(rig: EmulatedRig, world: PhysicalWorld, way: str) -> None:
    line(rig, 0.65, 0.0, 0.15)
    for _ in range(10):
        world.refill(everything=True) if way == "refill" else world.exchange()
        highest_n = 0.0
        for _ in range(round(0.5 / rig.robot.period_s)):
            rig.tick(0.0)
            highest_n = max(highest_n, rig.robot.sensor.pressing_n)
        assert highest_n < 20
    assert rig.robot.events == []


def test_physics_rests_with_the_rig(rig: EmulatedRig, world: PhysicalWorld) -> None:
    let_pass(rig, 2.0)
    steps = world.steps
    let_pass(rig, 2.0)
    assert world.steps == steps
    line(rig, 0.6, 0.0, 0.4)
    assert world.steps > steps


def test_measured_pose_is_where_the_arm_was_sent(rig: EmulatedRig) -> None:
    line(rig, 0.6, 0.05, 0.3)
    let_pass(rig, 0.5)
    sent = PlanarPose(x_m=0.6, y_m=0.05, angle_rad=0.0).pose_base_tool(0.3)
    assert matrix_of(rig.robot.pose) == pytest.approx(sent, abs=1e-3)
