"""Whatever is done to an export, reading it ends in attempts or in an error of this room, within bounded memory."""

from __future__ import annotations

import resource
import shutil
from pathlib import Path

import numpy as np
import pytest
from tests.support.factories import make_attempt, make_header, record
from tests.support.spoilt_exports import SPOILERS

from handsight.datasets import DatasetError, GraspDataset, GraspRepository, export_dataset
from handsight.datasets.curation.curator import Curator
from handsight.datasets.exchange import hdf5
from handsight.datasets.exchange.formats import format_named
from handsight.datasets.reading.selection import Selection

INPUTS = 80
MOST_BYTES = 5 * 10**8


@pytest.mark.no_cover
@pytest.mark.parametrize("name", SPOILERS)
@pytest.mark.filterwarnings("ignore::zarr.errors.ZarrUserWarning")
def test_a_spoilt_export_ends_in_attempts_or_an_error(
    repository: GraspRepository, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    header = make_header(seed=1)
    record(repository, header, [make_attempt(header, number) for number in range(3)])
    Curator(repository, author="jo").exclude(Selection(where="number == 1"), "dark")
    export_dataset(GraspDataset(repository, ref="main"), tmp_path / "good", format=name)
    chosen, spoilt = format_named(name), tmp_path / "spoilt"
    refused = 0
    # A process of its own for each, which the tests of the probe try, would take most of the time here.
    monkeypatch.setattr(hdf5, "refuse_unreadable", lambda path: None)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for seed in range(INPUTS):
        if (tmp_path / "good").is_dir():
            shutil.rmtree(spoilt, ignore_errors=True)
            shutil.copytree(tmp_path / "good", spoilt)
        else:
            shutil.copy(tmp_path / "good", spoilt)
        SPOILERS[name](spoilt, np.random.default_rng(seed))
        try:
            with chosen.open(spoilt) as bundle:
                for source in bundle.sessions:
                    assert len(list(source.attempts())) == source.size
        except DatasetError:
            refused += 1
        except Exception as error:
            error.add_note(f"seed {seed}")
            raise
    assert INPUTS // 4 < refused < INPUTS
    assert (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * 1024 < MOST_BYTES
