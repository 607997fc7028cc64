"""The paper's method and nothing else: pure PyTorch, without files or devices.

The homography that moves a picture as the gripper would move, the optimisers that search pre-grasp poses with it, and
the closed loop that servos until the predicted success is high enough. The network is any callable that scores a batch
of pictures and knows their grid, so this room imports no other; every other may import it.
"""
