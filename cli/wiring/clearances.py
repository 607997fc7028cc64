"""What ``handsight clearance`` does on a simulated station, and how its table looks on the screen."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

from handsight.cli.output import console, progress_bar
from handsight.cli.tables import Column, print_table
from handsight.cli.wiring.evaluation_tables import interval
from handsight.cli.wiring.stations import sim_station
from handsight.evaluation.clearance import ClearanceSettings, ClearedTable, clear_tables
from handsight.evaluation.clearance_rows import clearance_comparisons, clearance_rows, why_nothing_was_cleared
from handsight.evaluation.evaluate import TrialContextFactory
from handsight.evaluation.journal import perhaps_journal
from handsight.evaluation.journal_lines import TABLES
from handsight.jobs.engine import LOCAL, Engine
from handsight.servoing.methods.registry import METHODS
from handsight.training.run import load_run


def clear_with_model(
    model: Path,
    objects: str,
    settings: ClearanceSettings,
    *,
    gripper: str,
    per_scene: int | None,
    out: Path | None = None,
    engine: Engine = LOCAL,
) -> dict[str, Any]:
    """Clear the tables behind a progress bar; returns what ``clearance --json`` prints.

    Args:
        model: Folder of the run.
        objects: Name of the object set.
        settings: What to compare.
        gripper: Name of the gripper.
        per_scene: Objects of a table; as many as the set is usually dropped in, where None.
        out: Journal to begin or to go on with.
        engine: Where the workers run.

    Raises:
        ObjectSetError: A set that cannot be used.
        JournalError: The journal is one of another clearance, or none.
    """
    station = sim_station(objects, gripper=gripper, per_scene=per_scene)
    run = load_run(model)
    factory = TrialContextFactory(open_station=station, run=model, weights_sha256=run.weights_sha256)
    decides = {
        "weights_sha256": run.weights_sha256,
        "seed": settings.seed,
        "failures": settings.failures,
        **settings.servo.to_json(),
        "methods": {name: METHODS[name].to_json() for name in settings.methods},
        "objects": {objects: station.settings()},
    }
    each = len(settings.methods)
    with perhaps_journal(out, TABLES, decides) as journal, progress_bar("tables", settings.tables * each) as bar:
        known = [] if journal is None else journal.known(objects)
        bar.reached(sum(table.number < settings.tables for table in known))

        def on_table(table: ClearedTable) -> None:
            if journal is not None:
                journal.append(objects, table)
            bar.advance()

        tables = clear_tables(factory, settings, known=known, engine=engine, on_table=on_table)
    return {
        "rows": clearance_rows(tables, settings.methods),
        "comparisons": clearance_comparisons(tables, settings.methods),
        "fault": why_nothing_was_cleared(tables),
        "model": str(model),
        "weights_sha256": run.weights_sha256,
        "objects": objects,
        "objects_per_scene": station.objects_per_scene,
        "gripper": gripper,
        "seed": settings.seed,
        "threshold": settings.servo.threshold,
        "level": settings.servo.level,
        "failures": settings.failures,
        "methods": [METHODS[name].to_json() for name in settings.methods],
        "tables": [asdict(table) for table in tables],
    }


def print_clearances(results: dict[str, Any]) -> None:
    """The table, and the methods against the first."""
    cells = [
        (
            row["method"],
            f"{row['cleared']}/{row['objects']}",
            f"{row['cleared_share']:.1%}",
            interval(row["cleared_ci95"]),
            f"{row['emptied']}/{row['tables']}",
            "-" if row["attempts_per_object"] is None else f"{row['attempts_per_object']:.2f}",
            f"{row['successes']}/{row['attempts']}",
            f"{row['rate']:.1%}",
            interval(row["ci95"]),
        )
        for row in results["rows"]
    ]
    columns = (
        "method",
        Column(heading="cleared", rank=1),
        "share",
        Column(heading="95 % interval", rank=2),
        Column(heading="emptied", rank=3),
        "per object",
        Column(heading="grasped", rank=4),
        "success",
        Column(heading="95 % interval", rank=2),
    )
    print_table(columns, cells)
    if results["comparisons"]:
        console.print()
        console.print("tables cleared further than by the reference; two-sided p of the sign test")
        compared = [
            (row["method"], row["against"], str(row["pairs"]), str(row["won"]), str(row["lost"]), f"{row['p']:.2g}")
            for row in results["comparisons"]
        ]
        print_table(("method", "against", "tables", "won", "lost", "p"), compared)
