"""Assembles the ``handsight`` command and turns expected errors into one line and exit status 2."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from contextlib import nullcontext

import typer
from typer.main import get_command

from handsight import __version__
from handsight.cli.completion import bash_words
from handsight.cli.interrupts import INTERRUPTED, INTERRUPTS
from handsight.cli.lazy import LazyCommand, LazyGroup, lazy_app
from handsight.cli.leaving import leave

NOUNS = (
    LazyCommand(
        "demo",
        "demo:demo",
        "Collect, train, servo and show the results, in one go.",
        ("handsight demo", "handsight demo --out demo --attempts 200 --trials 20"),
        kept="what is finished is kept; run it again to go on",
    ),
    LazyCommand("collect", "collect:collect_app", "Collect grasp attempts into a dataset."),
    LazyCommand("dataset", "dataset.app:dataset_app", "Create, inspect and release grasp datasets."),
    LazyCommand(
        "train",
        "train:train_command",
        "Train a network on a version of a dataset.",
        (
            "handsight train grasps@v1 --out runs/rgbd",
            "handsight train grasps@v1 on-policy --out runs/mixed --viewpoint both",
            "handsight train grasps --out runs/fold0 --folds by-object:0 --size 2000 --channels depth",
        ),
        kept="every finished pass is kept; the same call with --resume goes on",
    ),
    LazyCommand("runs", "runs:runs_app", "List, inspect and compare trained runs."),
    LazyCommand("ablate", "ablate:ablate_app", "Compare what networks read, by how much they learn from."),
    LazyCommand(
        "crossval",
        "crossval:crossval_command",
        "Test a recipe on objects that its networks never saw.",
        (
            "handsight crossval grasps@v1 --out crossval",
            "handsight crossval grasps@v1 --trials 10 --channels depth --size 2000 --out crossval",
        ),
        kept="trials that are done are kept; the same call goes on",
    ),
    LazyCommand(
        "tune",
        "tune:tune_command",
        "Look for a better recipe.",
        (
            "handsight tune grasps@v1 --out tune",
            "handsight tune grasps@v1 --proposals 60 --trials 5 --size 5000 --out tune",
        ),
        kept="trials that are done are kept; the same call goes on",
    ),
    LazyCommand(
        "evaluate",
        "evaluate:evaluate_command",
        "Compare servo methods on the same trials.",
        (
            "handsight evaluate --model runs/rgbd",
            "handsight evaluate --model runs/rgbd --methods cem-1,first-order --trials 200 --json",
            "handsight evaluate --model runs/rgbd --objects household-test,blocks-test --out trials.jsonl",
        ),
        kept="no trial is kept but those in --out, with which the same call goes on",
    ),
    LazyCommand(
        "clearance",
        "clearance:clearance_command",
        "Clear tables object by object.",
        (
            "handsight clearance --model runs/rgbd",
            "handsight clearance --model runs/rgbd --methods random,cem-1 --objects clutter-test --tables 50",
            "handsight clearance --model runs/rgbd --tables 200 --out tables.jsonl",
        ),
        kept="no table is kept but those in --out, with which the same call goes on",
    ),
    LazyCommand(
        "prediction",
        "prediction:prediction_command",
        "Measure how wrong predicted pictures are.",
        (
            "handsight prediction --model runs/rgbd",
            "handsight prediction --model runs/rgbd --objects blocks-test --scenes 50 --json",
        ),
    ),
    LazyCommand(
        "heatmap",
        "heatmap:heatmap_command",
        "Record heatmaps of predicted success.",
        (
            "handsight heatmap grasps --model runs/rgbd",
            "handsight heatmap grasps 92 93 --model runs/rgbd --picture heatmaps.png",
        ),
        kept="a file is whole or was not written",
    ),
    LazyCommand(
        "servo",
        "servo:servo_command",
        "Servo once, grasp, and record every step.",
        ("handsight servo --model runs/rgbd", "handsight servo --model runs/rgbd --method first-order --trial 7"),
        kept="no recording was written",
    ),
    LazyCommand(
        "report",
        "report:report_command",
        "Write one page about a dataset, a run or a folder.",
        (
            "handsight report demo",
            "handsight report grasps@v1 --out grasps.html",
            "handsight report runs/rgbd --out run.html",
        ),
        kept="the page is whole or was not written",
    ),
    LazyCommand("view", "view.app:view_app", "Look at datasets, heatmaps and traces in the Rerun viewer."),
    LazyCommand(
        "review",
        "review:review_command",
        "Decide about attempts one by one, by single keys.",
        (
            "handsight review grasps --suspect -n 40",
            "handsight review grasps --where 'width_final_m < 0.004' --model runs/rgbd",
        ),
        kept="what was decided is committed",
    ),
    LazyCommand("rig", "rig.app:rig_app", "A UR10 rig: check, calibrate, home it, or emulate it."),
    LazyCommand("objects", "objects:objects_app", "Object sets of the simulated station."),
)
_COMPLETE = "_HANDSIGHT_COMPLETE"
"""Variable by which a shell asks for candidates or for its script."""
SHELLS = ("bash", "zsh", "fish")
"""Shells for which ``--show-completion`` can be asked by name."""


class Handsight(LazyGroup):
    """Everything behind ``handsight``."""

    table = NOUNS


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(__version__)
        raise typer.Exit


def _root(
    version: bool = typer.Option(
        False, "--version", callback=_print_version, is_eager=True, help="Print the version and exit."
    ),
) -> None:
    """A data engine for learning planar grasps from a camera on the gripper."""


app = lazy_app(
    Handsight,
    name="handsight",
    callback=_root,
    add_completion=True,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def run(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status: 0 done, 1 a check found something, 2 bad input."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    if len(words) == 2 and words[0] == "--show-completion" and words[1] in SHELLS:
        # The option alone looks which shell it was called from; this is how a shell asks for its own script.
        os.environ[_COMPLETE] = f"source_{words.pop()}"
    try:
        with bash_words() if os.environ.get(_COMPLETE) == "complete_bash" else nullcontext():
            get_command(app)(args=words, prog_name="handsight")
    except KeyboardInterrupt:
        return INTERRUPTED
    except SystemExit as leaving:
        return leaving.code if isinstance(leaving.code, int) else int(leaving.code is not None)
    except Exception as error:
        if INTERRUPTS.count:
            return INTERRUPTED  # Somebody on the way has made another error of Ctrl-C.
        from handsight.cli.errors import is_expected, report  # imports every room, which only a failure should pay for

        if not is_expected(error):
            raise
        report(error)
        return 2
    finally:
        os.environ.pop(_COMPLETE, None)  # it is about this call alone
    return 0


def main() -> None:
    """Entry point of the executable."""
    INTERRUPTS.install()
    status = run()
    INTERRUPTS.end()
    leave(status)
