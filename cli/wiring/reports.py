"""What ``handsight report`` tells of what it was given: a version, a run, a sweep, or a folder with any of these."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import handsight
from handsight.cli.errors import CommandError
from handsight.cli.opening import open_version
from handsight.cli.wiring.heatmaps import HeatmapRequest, make_heatmaps
from handsight.cli.wiring.replays import failure_blocks
from handsight.cli.wiring.sweep_readme import command_of
from handsight.datasets.address import DatasetAddress, looks_like_dataset
from handsight.datasets.errors import DatasetError
from handsight.datasets.reading.reader import GraspDataset
from handsight.servoing.errors import ServoingError
from handsight.training.run_folder import RUN_RECORD
from handsight.training.run_record import WEIGHTS_SHA256, origins_of, read_values
from handsight.training.sweep.plan import read_plan
from handsight.viz.errors import VizError
from handsight.viz.report.content import Note, Report, Section
from handsight.viz.report.dataset_part import dataset_section
from handsight.viz.report.evaluation_part import evaluation_section
from handsight.viz.report.folder import FolderContents, files_section, folder_contents, is_sweep
from handsight.viz.report.heatmap_part import heatmap_section
from handsight.viz.report.run_part import run_section
from handsight.viz.report.sweep_part import sweep_section

HEATMAPS = 4
"""Attempts whose heatmaps are drawn."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportSettings:
    """What of a report takes time."""

    replays: int
    """Failed trials that are simulated again for their pictures."""
    heatmaps: bool = True


def report_on(what: str, settings: ReportSettings, *, out: Path) -> Report:
    """The report on a dataset, a run, a sweep or a folder.

    Args:
        what: As it was given.
        settings: What to draw.
        out: Where the report goes, which its command names.

    Raises:
        ReportError: There is nothing there of which a report can tell.
    """
    folder = Path(what)
    if (folder / RUN_RECORD).is_file():
        sections = [run_section(folder)]
    elif is_sweep(folder):
        sections = [_sweep(folder)]
    elif folder.is_dir() and not looks_like_dataset(folder):
        sections = list(_folder(folder, settings))
    else:
        sections = [dataset_section(open_version(what), what)]
    titles = ", ".join(_lower(section.title) for section in sections)
    return Report(
        title=f"{what} · handsight report",
        summary=f"This page tells of: {titles}.",
        command=shlex.join(("handsight", "report", what, "--out", str(out))),
        handsight=handsight.__version__,
        sections=tuple(sections),
    )


def _lower(title: str) -> str:
    return title[:1].lower() + title[1:]


def _sweep(folder: Path) -> Section:
    return sweep_section(folder, command_of(read_plan(folder)).replace("DIR", shlex.quote(str(folder))))


def _folder(folder: Path, settings: ReportSettings) -> Iterator[Section]:
    found = folder_contents(folder)
    yield from _evaluations(found, settings)
    for path in found.sweeps:
        yield _sweep(path)
    for run in found.runs:
        yield run_section(run)
        if settings.heatmaps and (section := _heatmaps(run, found)) is not None:
            yield section
    for dataset in found.datasets:
        address = _address(dataset, found)
        yield dataset_section(open_version(address), address)
    if (files := files_section(found)) is not None:
        yield files


def _address(dataset: Path, found: FolderContents) -> str:
    """The version of a dataset that the runs beside it were trained on; its newest where there is none."""
    for run in found.runs:
        for origin in origins_of(read_values(run / RUN_RECORD)):
            if _is_of(origin, dataset):
                with suppress(DatasetError):
                    address = f"{dataset}@{origin['ref']}"
                    GraspDataset.open(address)
                    return address
    return str(dataset)


def _is_of(origin: dict[str, Any], dataset: Path) -> bool:
    """Whether an origin names a dataset that lies where it was, or in a folder that was moved as a whole."""
    named = DatasetAddress.parse(str(origin["dataset"])).path
    return isinstance(named, Path) and named.name == dataset.name


def _heatmaps(run: Path, found: FolderContents) -> Section | None:
    """Heatmaps of attempts that a run was trained on, where the data are beside it, or why there are none."""
    for dataset in found.datasets:
        if any(_is_of(origin, dataset) for origin in origins_of(read_values(run / RUN_RECORD))):
            address = _address(dataset, found)
            try:
                made = make_heatmaps(open_version(address), run, HeatmapRequest(wrong=True, count=HEATMAPS))
                return heatmap_section(made.examples, made.overview, address=address, run=run)
            except (CommandError, ServoingError, VizError) as error:
                return Section(title=f"Heatmaps of {run}", blocks=(Note(text=f"There are none: {error}."),))
    return None


def _evaluations(found: FolderContents, settings: ReportSettings) -> Iterator[Section]:
    for path, results in found.evaluations:
        run = next((one for one in found.runs if _weights_of(one) == results["weights_sha256"]), None)
        blocks = failure_blocks(run, results, settings.replays) if run is not None else ()
        yield evaluation_section(results, title=f"Evaluation {path.name}", failures=tuple(blocks))


def _weights_of(run: Path) -> str | None:
    weights: str | None = read_values(run / RUN_RECORD).get(WEIGHTS_SHA256)
    return weights
