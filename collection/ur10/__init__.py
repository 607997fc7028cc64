"""The real UR10 rig: arm, gripper and camera behind their vendors' own clients, and what keeps a week of them safe."""
