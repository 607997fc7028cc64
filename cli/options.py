"""Options and arguments that several commands share, with what they default to."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final, Literal

import typer

from handsight.cli.completion import (
    complete_attempt,
    complete_branch,
    complete_branch_name,
    complete_dataset,
    complete_filter,
    complete_objects,
    complete_version,
)

TRAINING_OBJECTS = "household-train"
"""What is grasped where training data are collected."""
NOVEL_OBJECTS = "household-test"
"""What is grasped where methods are compared: objects that training never saw."""
DEFAULT_GRIPPER: Final = "2f-85"
"""``config.SimConfig`` has it too, and a test that they agree."""
METHOD_NAMES = ("random", "cem-5", "cem-1", "first-order", "second-order", "gauss-newton", "global")
"""Servo methods, for completion; the registry has them too, and a test that they agree."""
EXPORT_FORMAT_NAMES = ("hdf5", "zarr", "lerobot")
FORMAT_NAMES = (*EXPORT_FORMAT_NAMES, "images")
DISTURBANCES = ("hand-eye:5mm", "hand-eye:2deg", "moved:20mm", "depth-noise:4mm", "depth-noise:d435")
VARIED_KINDS = ("table", "light", "colour", "friction", "depth-noise", "all")
"""Likewise of other rooms, with a test that they agree."""
DEFAULT_METHOD = "global"
"""How a network servoes unless another method is named."""
DEFAULT_THRESHOLD = 0.95
"""Predicted success at which is grasped; ``ServoSettings`` has it too, and a test that they agree."""
RIG_THRESHOLD = 0.85
"""The same on a rig (section V-C)."""
EVALUATION_SEED = 1_000_000
"""Where trials begin; ``EvaluationSettings`` has it too, and a test that they agree."""

LARGEST_SEED = 2**63 - 1
"""Seeds are stored as signed whole numbers of 64 bits."""
MOST_WORKERS = 1024
MOST_TRIALS = 1_000_000
MOST_EPOCHS = 100_000
MOST_ATTEMPTS = 10_000_000
"""Of one session: its numbers, and what is asked of one call, stay far from what a machine can hold."""

# Where a dataset is, and which version of it.
Dataset = Annotated[
    str,
    typer.Argument(
        metavar="DATASET[@REF]", help="Dataset folder, optionally at a version.", autocompletion=complete_version
    ),
]
Datasets = Annotated[
    list[str],
    typer.Argument(
        metavar="DATASET[@REF]...",
        help="Dataset folders, each optionally at a version.",
        autocompletion=complete_version,
    ),
]
DatasetPath = Annotated[
    str,
    typer.Argument(metavar="DATASET", help="Dataset folder, or s3://bucket/prefix.", autocompletion=complete_dataset),
]
DatasetBranch = Annotated[
    str,
    typer.Argument(
        metavar="DATASET[@BRANCH]", help="Dataset folder, optionally at a branch.", autocompletion=complete_branch
    ),
]
TargetBranch = Annotated[
    str, typer.Option("--branch", help="Branch of the target that moves.", autocompletion=complete_branch_name)
]
NewBranch = Annotated[
    str, typer.Option("--branch", help="Name of the branch to make; the version itself stays as it is.")
]

# Which attempts.
Ids = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="[ATTEMPT]...",
        help="Ids as printed by ls, unique beginnings of them, or numbers.",
        autocompletion=complete_attempt,
    ),
]
Where = Annotated[
    str, typer.Option("--where", metavar="EXPRESSION", help="Attempts for which this holds: \"target == 'cup'\".")
]
Filter = Annotated[
    str, typer.Option("--filter", metavar="NAME", help="Attempts of a saved filter.", autocompletion=complete_filter)
]

# Who changes a dataset, why, and whether at all.
Author = Annotated[
    str,
    typer.Option("--author", envvar="HANDSIGHT_AUTHOR", help="Who did it.", show_default="the user's name"),
]
Reason = Annotated[str, typer.Option("--reason", "-m", help="Why; kept with the decision.")]
Message = Annotated[str, typer.Option("--message", "-m", help="What it is for; kept with the version.")]
DryRun = Annotated[bool, typer.Option("--dry-run", help="Check and say what would be done, and do nothing.")]

# Networks, and how they servo.
Model = Annotated[Path, typer.Option("--model", metavar="RUN", help="Folder of a trained run.")]
Threshold = Annotated[float, typer.Option(help="Predicted success at which the grasp is executed.")]
TrialSeed = Annotated[
    int, typer.Option("--seed", min=0, max=LARGEST_SEED, help="Scenes and starting poses follow from it.")
]

Level = Annotated[
    bool,
    typer.Option(
        "--level", help="Turn what the camera sees until the table in it is level, for a mount that was knocked."
    ),
]

# Who watches.
Live = Annotated[bool, typer.Option("--live", help="Show every step in a Rerun viewer while it happens.")]
LiveUrl = Annotated[
    str | None,
    typer.Option(
        "--live-url", metavar="URL", help="As --live, in a viewer that runs: rerun+http://127.0.0.1:9876/proxy."
    ),
]

# The simulated station, and who works on it.
Seed = Annotated[int, typer.Option("--seed", min=0, max=LARGEST_SEED, help="Everything random follows from it.")]
Workers = Annotated[
    int, typer.Option("--workers", "-w", max=MOST_WORKERS, help="Processes, each with a station of its own.")
]
Objects = Annotated[
    str,
    typer.Option(
        "--objects", metavar="SET", help="Object set; see 'handsight objects ls'.", autocompletion=complete_objects
    ),
]
PerScene = Annotated[
    int | None,
    typer.Option(
        "--objects-per-scene", min=1, max=1000, help="Objects in a scene; unless given 5, and 10 for the clutter sets."
    ),
]
Gripper = Annotated[
    Literal["2f-85", "2f-140"],
    typer.Option("--gripper", help="Gripper of the simulated station, by its stroke of 85 or 140 mm."),
]
EngineName = Annotated[
    Literal["local", "ray"],
    typer.Option("--engine", help="Where the workers run: on this machine, or on a Ray cluster."),
]
RayAddress = Annotated[
    str | None,
    typer.Option(
        "--ray-address",
        metavar="HOST:PORT",
        help="Head of the Ray cluster; unless given $RAY_ADDRESS, or else a cluster of this machine alone.",
    ),
]
Renderer = Annotated[
    Literal["tiny", "egl", "auto"],
    typer.Option(
        "--renderer",
        help="Who draws: tiny gives the same bytes on every machine, egl needs OpenGL, auto times both and takes egl "
        "where it is a tenth faster.",
    ),
]

# The real rig.
RigFile = Annotated[Path, typer.Option("--rig", metavar="FILE", help="The rig's file; see docs/rig.md.")]

Json = Annotated[bool, typer.Option("--json", help="Print one JSON value instead of text.")]
