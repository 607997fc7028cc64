"""The simulated station: a UR10 with a parallel gripper and a camera on the hand, in PyBullet.

The only place that imports PyBullet and the arm's inverse kinematics. The arm moves to where it is sent, and a pose
out of its reach is reported. Attempt *i* of a session depends on the session's seed and *i* alone, so that any number
of workers, stopped and resumed at will, produce the same bytes.
"""
