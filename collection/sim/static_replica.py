"""A static replica of the station, with everything that the attempt's own world leaves out for speed.

It is put together from what a dataset records, tool pose, jaw opening and objects, so it shows recorded attempts as
well as running ones and cannot touch the physics of either.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from handsight.collection.sim.arm import BASE_ORIENTATION
from handsight.collection.sim.arm_model import ARM_JOINTS, FINGER_JOINTS, temporary_arm_urdf
from handsight.collection.sim.bullet import BulletClient, connect, pybullet
from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.grippers import gripper_named
from handsight.collection.sim.kinematics import REFERENCE_RAD, joints_for
from handsight.collection.sim.objects.catalogue import load_object_set
from handsight.collection.sim.table import TABLE_CENTRE_M, TABLE_HALF_SIZE_M, WOOD_RGB
from handsight.datasets.records import SceneObjects

TABLE_BOARD_M = 0.05
BELOW_TOP_M = 5e-4
"""The board ends this far below the table top, which is drawn in closed form, so that the two never compete."""
EDGE_SHADE = 0.75
ARM_RGBA = (0.84, 0.86, 0.89, 1.0)
CAMERA_RGBA = (0.72, 0.74, 0.77, 1.0)
CAMERA_HALF_SIZE_M = (0.045, 0.0125, 0.0125)
"""Half the D435's housing, along the axes of the camera frame (datasheet: 90 x 25 x 25 mm)."""


class StaticReplica:
    """Arm, gripper, hand camera, table and objects in a Bullet client of their own, with all their visual meshes."""

    def __init__(self, config: SimConfig) -> None:
        """Load everything but the objects; the arm's meshes take half a second.

        Raises:
            ObjectSetError: Unknown object set.
        """
        self._config = config
        self._models = load_object_set(config.objects)
        self.bullet: BulletClient = connect()
        self._load_arm()
        self._camera = self._add_box(CAMERA_HALF_SIZE_M, CAMERA_RGBA)
        self._add_board()
        self._catalogue_index: list[int] = []
        self._bodies: list[int] = []

    def _load_arm(self) -> None:
        folder, urdf = temporary_arm_urdf(gripper_named(self._config.gripper), with_visuals=True)
        with folder:
            self._arm: int = self.bullet.loadURDF(str(urdf), (0, 0, 0), BASE_ORIENTATION, useFixedBase=True)
        joints = range(self.bullet.getNumJoints(self._arm))
        index = {self.bullet.getJointInfo(self._arm, joint)[1].decode(): joint for joint in joints}
        self._joints = [index[name] for name in ARM_JOINTS]
        self._fingers = [index[name] for name in FINGER_JOINTS]
        for shape in self.bullet.getVisualShapeData(self._arm):
            if shape[2] == pybullet.GEOM_MESH:
                self.bullet.changeVisualShape(self._arm, shape[1], rgbaColor=ARM_RGBA)

    def _add_board(self) -> None:
        half_size = (TABLE_HALF_SIZE_M, TABLE_HALF_SIZE_M, 0.5 * TABLE_BOARD_M)
        red, green, blue = (EDGE_SHADE * colour / 255 for colour in WOOD_RGB)
        board = self._add_box(half_size, (red, green, blue, 1.0))
        centre = (*TABLE_CENTRE_M, -BELOW_TOP_M - 0.5 * TABLE_BOARD_M)
        self.bullet.resetBasePositionAndOrientation(board, centre, (0, 0, 0, 1))

    def _add_box(self, half_size_m: tuple[float, float, float], rgba: tuple[float, float, float, float]) -> int:
        shape = self.bullet.createVisualShape(pybullet.GEOM_BOX, halfExtents=half_size_m, rgbaColor=rgba)
        body: int = self.bullet.createMultiBody(0, -1, shape)
        return body

    def arrange(self, pose_base_tool: NDArray[np.float64], width_m: float, scene: SceneObjects) -> None:
        """Put everything where it was.

        Args:
            pose_base_tool: Tool frame in the base frame. Shape (4, 4).
            width_m: Opening between the jaws [m].
            scene: The objects and where they lie.

        Raises:
            UnreachableError: The arm cannot stand like this.
        """
        self._place_arm(pose_base_tool, width_m)
        self._place_objects(scene)

    def _place_arm(self, pose_base_tool: NDArray[np.float64], width_m: float) -> None:
        angles_rad = joints_for(pose_base_tool, REFERENCE_RAD, phase="picture")
        for joint, angle_rad in zip(self._joints, angles_rad.tolist(), strict=True):
            self.bullet.resetJointState(self._arm, joint, angle_rad)
        for joint in self._fingers:
            self.bullet.resetJointState(self._arm, joint, 0.5 * width_m)
        pose_base_camera = self._config.camera.pose_base_camera(pose_base_tool)
        housing_m = pose_base_camera[:3, 3] - CAMERA_HALF_SIZE_M[2] * pose_base_camera[:3, 2]
        self.bullet.resetBasePositionAndOrientation(
            self._camera, housing_m.tolist(), _quaternion(pose_base_camera[:3, :3])
        )

    def _place_objects(self, scene: SceneObjects) -> None:
        wanted = scene.catalogue_index.tolist()
        if wanted != self._catalogue_index:
            for body in self._bodies:
                self.bullet.removeBody(body)
            models = [self._models[index] for index in wanted]
            self._bodies = [self.bullet.loadURDF(str(model.urdf), globalScaling=model.scale) for model in models]
            self._catalogue_index = wanted
        for body, pose in zip(self._bodies, scene.pose_base_object.tolist(), strict=True):
            self.bullet.resetBasePositionAndOrientation(body, pose[:3], pose[3:])

    def close(self) -> None:
        """Stop the client."""
        self.bullet.disconnect()


def _quaternion(rotation: NDArray[np.float64]) -> list[float]:
    """A rotation matrix (3, 3) as x y z w."""
    quaternion: list[float] = Rotation.from_matrix(rotation).as_quat().tolist()
    return quaternion
