"""Random episodes of PyBullet's ``KukaDiverseObjectEnv``: run by ``kuka.py``, in an environment of its own.

Its gym needs another NumPy than handsight, so nothing of handsight is imported, and gym only by name.
"""

from __future__ import annotations

import importlib
import json
import random
import sys
import time
from typing import Any

SEED = 0


def play(env: Any, episodes: int) -> int:
    """Play episodes with random actions to their ends; returns in how many of them the gripper closed."""
    attempts = 0
    for _ in range(episodes):
        env.reset()
        done = False
        while not done:
            _, _, done, _ = env.step(env.action_space.sample())
        # An episode also ends after eight actions, be the gripper down or not.
        attempts += bool(env._attempted_grasp)
    return attempts


def main() -> None:
    """Print episodes, attempts and seconds as a JSON object, on the last line."""
    episodes = int(sys.argv[1])
    module = importlib.import_module("pybullet_envs.bullet.kuka_diverse_object_gym_env")
    env = module.KukaDiverseObjectEnv(renders=False, isDiscrete=False)
    # The environment draws objects and poses from these two, and has no other way to be seeded.
    random.seed(SEED)
    importlib.import_module("numpy").random.seed(SEED)
    env.action_space.seed(SEED)
    play(env, 1)
    start_s = time.perf_counter()
    attempts = play(env, episodes)
    elapsed_s = time.perf_counter() - start_s
    sys.stdout.write("\n" + json.dumps({"episodes": episodes, "attempts": attempts, "elapsed_s": elapsed_s}) + "\n")


if __name__ == "__main__":
    main()
