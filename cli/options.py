"""Options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

TRAINING_OBJECTS = "household-train"
"""What is grasped where training data are collected."""
NOVEL_OBJECTS = "household-test"
"""What is grasped where methods are compared: objects that training never saw."""

Dataset = Annotated[str, typer.Argument(metavar="DATASET[@REF]", help="Dataset folder, optionally at a version.")]
DatasetPath = Annotated[str, typer.Argument(metavar="DATASET", help="Dataset folder, or s3://bucket/prefix.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON value instead of text.")]
Model = Annotated[Path, typer.Option("--model", metavar="RUN", help="Folder of a trained run.")]
Seed = Annotated[int, typer.Option("--seed", help="Everything random follows from it.")]
Workers = Annotated[int, typer.Option("--workers", "-w", help="Processes, each with a station of its own.")]
Objects = Annotated[str, typer.Option("--objects", metavar="SET", help="Object set; see 'handsight objects ls'.")]
PerScene = Annotated[
    int | None,
    typer.Option("--objects-per-scene", help="Objects in a scene; unless given 5, and 10 for the clutter sets."),
]
