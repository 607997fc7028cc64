"""``handsight rig``: the real rig, and an emulated one."""
