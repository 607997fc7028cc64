"""handsight: a data engine for learning planar grasps from a camera on the gripper.

Each subpackage is one top-level folder of the repository (see ARCHITECTURE.md); imports run one way:
``servoing``, ``jobs`` <- ``datasets`` <- ``collection``, ``training`` <- ``evaluation`` <- ``viz`` <- ``cli``.
"""

__version__ = "0.1.0"
