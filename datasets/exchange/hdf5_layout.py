"""What an HDF5 file of grasp attempts looks like: robomimic's layout, one demo for each attempt, one step in each demo.

::

    /                                   attrs: handsight (origin, JSON)
    /data                               attrs: total, env_args (JSON), as robomimic wants them
    /data/demo_<k>                      attrs: num_samples, attempt (id)
        actions                         f8 (1, 3), pre-grasp x [m], y [m], angle [rad] in the base frame
        rewards, dones                  f8 (1,), 1 where the grasp succeeded; i8 (1,), always 1
        obs/<viewpoint>_rgb             u1 (1, H, W, 3)
        obs/<viewpoint>_depth           u2 (1, H, W), in units of the camera's depth scale
        obs/<viewpoint>_pose_base_tool  f8 (1, 4, 4); nothing of a viewpoint whose picture was never taken
    /unlabelled/demo_<k>                the same of attempts that did not run to their end
    /mask/labelled, /mask/excluded      names of demos of data, as robomimic's filter keys
    /sessions/<ulid>                    attrs: first_demo
        attributes                      JSON: header, configuration, code version, packages, times, status
        columns/<column>                (N, ...), as in schema.py
    /decisions                          JSON: curation

Without a filter key robomimic reads all of ``data``, and stumbles over a demo that lacks a picture. So only attempts
with a label are there; older exports have the others among them, and no group ``unlabelled``. What robomimic does not
read (`handsight`, `unlabelled`, `sessions`, `decisions`) is what brings every byte back.
"""

from __future__ import annotations

from typing import Any

import h5py

DATA = "data"
UNLABELLED = "unlabelled"
MASKS = ("labelled", "excluded")


def group_of_demo(*, labelled: bool) -> str:
    """The group that the demo of an attempt is written to."""
    return DATA if labelled else UNLABELLED


def demo_named(file: h5py.File, name: str) -> Any:  # h5py says of what is in a file no more than Any.
    """The demo of that name, from whichever group has it; None where neither has."""
    groups = (file.get(group) for group in (DATA, UNLABELLED))
    return next((group[name] for group in groups if isinstance(group, h5py.Group) and name in group), None)


def demo_names(file: h5py.File) -> dict[str, set[str]]:
    """Names of the demos of each group."""
    groups = {group: file.get(group) for group in (DATA, UNLABELLED)}
    return {name: set(group) if isinstance(group, h5py.Group) else set() for name, group in groups.items()}
