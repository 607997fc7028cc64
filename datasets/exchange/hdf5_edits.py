"""What the user of an HDF5 export changed in the part of it that robomimic reads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import h5py
import numpy as np
from numpy.typing import NDArray

from handsight.datasets.errors import counted
from handsight.datasets.exchange.edits import Comparison, Edits, session_ids
from handsight.datasets.exchange.hdf5_layout import DATA, MASKS, UNLABELLED, demo_named, demo_names
from handsight.datasets.exchange.sources import SessionSource
from handsight.datasets.format.decisions import Decision, Overlay
from handsight.datasets.format.schema import SESSIONS, VIEWPOINTS

DEMO_MEMBERS = {"actions", "rewards", "dones", "obs"}
OBSERVED = ("rgb", "depth", "pose_base_tool")
_MOST_NAME_BYTES = 64
"""Of a demo in a filter key."""


def edits_of(file: h5py.File, sources: Sequence[SessionSource], decisions: Sequence[Decision], name: str) -> Edits:
    """Compare demos and filter keys with the columns of their sessions.

    Args:
        file: The export, whose columns have been checked.
        sources: Its sessions.
        decisions: Its curation.
        name: What it is called in reasons and messages.

    Raises:
        InterchangeError: Something was changed that no decision can hold; the message lists it.
        KeyError, TypeError, ValueError, OSError, RuntimeError: The file is damaged or foreign.
    """
    comparison = Comparison(name)
    ids: dict[str, str] = {}
    labelled: set[str] = set()
    for source in sources:
        group = file[f"{SESSIONS}/{source.ulid}"]
        first = int(group.attrs["first_demo"])
        demos = [f"demo_{first + number}" for number in range(source.size)]
        comparison.refuse("demos belong to two sessions", [demo for demo in demos if demo in ids])
        ids |= dict(zip(demos, session_ids(source.ulid, source.size), strict=True))
        labelled |= _compare_demos(comparison, file, group, demos, ids)
    there = demo_names(file)
    comparison.refuse("demos were added", sorted((there[DATA] | there[UNLABELLED]) - set(ids)))
    readable = labelled if UNLABELLED in file else set(ids)
    misplaced = (there[DATA] & set(ids)) - readable | there[UNLABELLED] & readable
    comparison.refuse(f"demos of {DATA} and {UNLABELLED} changed places", sorted(misplaced))
    if file[DATA].attrs.get("total") != len(readable):
        comparison.refuse(f"data's total is not {counted(len(readable), 'demo')}", [DATA])
    known = {demo: ids[demo] for demo in readable}
    _compare_masks(comparison, file, known, labelled, set(Overlay(decisions).exclusions.index))
    return comparison.edits("rewards and mask/excluded")


def _compare_demos(
    comparison: Comparison, file: h5py.File, group: h5py.Group, demos: Sequence[str], ids: Mapping[str, str]
) -> set[str]:
    """Compare the demos of one session; returns those whose attempts ran to their end."""
    outcome, poses, taken = (
        np.asarray(group[f"columns/{name}"][()]) for name in ("outcome", "pregrasp_x_y_angle", "picture_taken")
    )
    nodes = [demo_named(file, demo) for demo in demos]
    present = [isinstance(node, h5py.Group) for node in nodes]
    comparison.refuse("demos are missing", [demo for demo, there in zip(demos, present, strict=True) if not there])
    rewards, actions, kept = [], [], []
    faults: dict[str, list[str]] = {}
    for at in np.flatnonzero(present).tolist():
        demo = nodes[at]
        found = _faults_of_demo(demo, ids[demos[at]], taken[at])
        for fault in found:
            faults.setdefault(fault, []).append(demos[at])
        if not found:
            kept.append(at)
            rewards.append(float(demo["rewards"][()].item()))
            actions.append(demo["actions"][0])
    for fault, places in faults.items():
        comparison.refuse(fault, places)
    places = [demos[at] for at in kept]
    if kept:
        here = [ids[place] for place in places]
        comparison.labels("rewards", np.array(rewards), outcome=outcome[kept], ids=here, places=places)
        comparison.same("actions", np.array(actions), poses[kept], places)
    return {demo for demo, one in zip(demos, outcome, strict=True) if one in (0, 1)}


def _faults_of_demo(demo: h5py.Group, identity: str, taken: NDArray[np.bool_]) -> list[str]:
    """What is wrong with a demo, whatever its numbers."""
    members = {f"obs/{view}_{one}" for view, there in zip(VIEWPOINTS, taken, strict=True) if there for one in OBSERVED}
    found = {f"obs/{name}" for name in demo["obs"]} if isinstance(demo.get("obs"), h5py.Group) else set()
    faults = [f"{name} was added" for name in sorted((set(demo) - DEMO_MEMBERS) | (found - members))]
    faults += [f"{name} is missing" for name in sorted((DEMO_MEMBERS - set(demo)) | (members - found))]
    if not np.array_equal(demo.attrs.get("attempt"), identity):
        faults.append("attempt names another attempt")
    if not np.array_equal(demo.attrs.get("num_samples"), 1):
        faults.append("num_samples is not 1")
    for name, size in (("rewards", 1), ("dones", 1), ("actions", 3)):
        node = demo.get(name)
        if node is not None and not _is_numeric(node, size):
            faults.append(f"{name} is not {counted(size, 'number')}")
    if not faults and demo["dones"][()].item() != 1:
        faults.append("dones is not 1")
    return faults


def _is_numeric(node: object, size: int) -> bool:
    return isinstance(node, h5py.Dataset) and node.dtype.kind in "biuf" and node.shape in ((1,), (1, size))[size > 1 :]


def _compare_masks(
    comparison: Comparison, file: h5py.File, ids: Mapping[str, str], labelled: set[str], excluded: set[str]
) -> None:
    masks = file["mask"] if isinstance(file.get("mask"), h5py.Group) else {}
    comparison.refuse("filter keys were added", [f"mask/{name}" for name in sorted(set(masks) - set(MASKS))])
    comparison.refuse("filter keys are missing", [f"mask/{name}" for name in MASKS if name not in masks])
    names = {key: _names(masks[key], len(ids)) for key in MASKS if key in masks}
    for key, found in names.items():
        if found is None:
            comparison.refuse("filter keys list no demos, or some twice", [f"mask/{key}"])
        else:
            comparison.refuse(f"mask/{key} names demos that are not there", sorted(found - set(ids)))
    if names.get("labelled") is not None:
        differing = sorted((names["labelled"] or set()) ^ labelled)
        comparison.refuse("mask/labelled differs from who ran to the end", differing)
    now = names.get("excluded")
    if now is not None:
        comparison.exclusions({ids[name] for name in now if name in ids}, excluded & set(ids.values()))


def _names(node: object, most: int) -> set[str] | None:
    """The demos that a filter key names; None where it is none."""
    if not isinstance(node, h5py.Dataset) or node.ndim != 1 or node.shape[0] > most:
        return None
    if node.shape[0] == 0:
        return set()
    text = h5py.check_string_dtype(node.dtype)
    if text is None or (text.length or 0) > _MOST_NAME_BYTES:
        return None
    names = node.asstr()[()].tolist()
    return set(names) if len(set(names)) == len(names) else None
