"""An emulated UR10 rig: controller, gripper and camera on loopback addresses, which the real drivers take for real.

It runs in a process of its own, ``python -m handsight.collection.ur10.emulator``, because constructors of ``ur_rtde``
keep Python's lock until the controller answers. Nothing of handsight's own driver is imported here: client and
emulator share the protocol's facts, not code.
"""
