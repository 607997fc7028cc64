"""The real rig: UR10, RealSense D435 and a parallel gripper, and an emulated one for their drivers."""
