"""What comes back from a LeRobotDataset that was exported, and folders that are refused."""

from __future__ import annotations

import json
import os
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from tests.support.factories import make_attempt, make_header, record
from tests.support.foreign_sets import damage_folder

from handsight.datasets import (
    CorruptDataError,
    DatasetError,
    GraspDataset,
    GraspRepository,
    InterchangeError,
    export_dataset,
    import_dataset,
)
from handsight.datasets.exchange.pictures import decoded, tiff


def _foreign_lerobot(path: Path) -> None:
    shutil.rmtree(path / "meta/handsight")


def _truncate_data(path: Path) -> None:
    file = path / "data/chunk-000/file-000.parquet"
    os.truncate(file, file.stat().st_size // 2)


def _pickle_column(path: Path) -> None:
    file = next((path / "meta/handsight").glob("*.npz"))
    with zipfile.ZipFile(file, "w") as archive, archive.open("attempts.number.npy", "w") as entry:
        np.lib.format.write_array(entry, np.array([{}], dtype=object), allow_pickle=True)


def _climb(path: Path) -> None:
    file = next((path / "meta/handsight").glob("*.npz"))
    file.rename(file.with_name("..npz"))


def _claim_rows(path: Path) -> None:
    """A header of a hundred bytes that asks for a terabyte."""
    file = next((path / "meta/handsight").glob("*.npz"))
    with zipfile.ZipFile(file, "w") as archive, archive.open("attempts.number.npy", "w") as entry:
        np.lib.format.write_array_header_1_0(entry, {"descr": "<i8", "fortran_order": False, "shape": (10**11,)})


def _open_bracket(path: Path) -> None:
    """A header that NumPy hands to Python's tokenizer, which comes to no end of it."""
    file = next((path / "meta/handsight").glob("*.npz"))
    header = b"{'descr': '<i8', 'fortran_order': False, 'shape': (3L,\n"
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("attempts.number.npy", b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header)


def _begin_nowhere(path: Path) -> None:
    file = next((path / "meta/handsight").glob("0*.json"))
    described = json.loads(file.read_text())
    file.write_text(json.dumps({**described, "first_episode": float("inf")}))


def _edited_rows(edit: Callable[[list[dict[str, Any]]], object]) -> Callable[[Path], None]:
    """What a user does who opens a data file, changes something, and writes it again, one row in each group."""

    def apply(path: Path) -> None:
        file = path / "data/chunk-000/file-000.parquet"
        schema, rows = pq.read_schema(file), pq.read_table(file).to_pylist()
        edit(rows)
        pq.write_table(pa.Table.from_pylist(rows, schema=schema), file, row_group_size=1)

    return apply


def _lift(rows: list[dict[str, Any]]) -> None:
    row = next(one for one in rows if one["valid.overhead"])["observation.depth.overhead"]
    row["bytes"] = tiff(decoded(row["bytes"]) + np.float32(0.25))


def _enlarge(rows: list[dict[str, Any]]) -> None:
    row = next(one for one in rows if one["valid.overhead"])["observation.depth.overhead"]
    row["bytes"] = tiff(np.zeros((600, 800), np.float32))


def _deny(rows: list[dict[str, Any]]) -> None:
    next(one for one in rows if one["valid.pregrasp"])["valid.pregrasp"] = False


BAD_LEROBOT: dict[str, tuple[Callable[[Path], None], str]] = {
    "foreign": (_foreign_lerobot, "lacks what handsight exports"),
    "truncated": (_truncate_data, "cannot be read from"),
    "pickle": (_pickle_column, "lacks what handsight exports"),
    "session name": (_climb, "lacks what handsight exports|its 3 attempts in 1 session are not those"),
    "a bomb of rows": (_claim_rows, "claims 100000000000 attempts, and the data have 24 rows"),
    "an open bracket": (_open_bracket, r"lacks what handsight exports .*\(TokenError"),
    "no first episode": (_begin_nowhere, "first_episode of session .* is inf, expected a whole number of 0 to 24"),
    "depth between units": (_edited_rows(_lift), "not in whole units of 0.001 m: it was changed"),
    "another size": (_edited_rows(_enlarge), "a picture has 800x600 pixels, expected 8x6"),
    "a flag": (_edited_rows(_deny), "valid.pregrasp is False, and what was recorded says True"),
    "link": (lambda path: (path / "data/x").symlink_to("/"), "holds a link at"),
}


@pytest.mark.parametrize("name", BAD_LEROBOT)
def test_a_bad_lerobot_folder_is_refused_and_leaves_nothing(dataset: GraspDataset, tmp_path: Path, name: str) -> None:
    damage, message = BAD_LEROBOT[name]
    export_dataset(dataset, tmp_path / "out", format="lerobot")
    damage(tmp_path / "out")
    with pytest.raises((InterchangeError, CorruptDataError), match=message):
        import_dataset(tmp_path / "out", tmp_path / "new")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["grasps", "out"]


@pytest.mark.no_cover
def test_a_damaged_export_is_refused_or_whole(repository: GraspRepository, tmp_path: Path) -> None:
    """Whatever is damaged, nothing but an error of ours comes out, in one line, or the content that was recorded."""
    header = make_header()
    record(repository, header, [make_attempt(header, number) for number in range(5)])
    dataset = GraspDataset(repository, ref="main")
    export_dataset(dataset, tmp_path / "whole", format="lerobot")
    for seed in range(60):
        source, said = shutil.copytree(tmp_path / "whole", tmp_path / "out"), ""
        done = damage_folder(source, np.random.default_rng(seed))
        try:
            import_dataset(source, tmp_path / "back")
        except DatasetError as error:
            said = str(error)
        except BaseException as error:
            error.add_note(f"seed {seed}: {done}")
            raise
        assert "\n" not in said
        if not said:
            assert GraspDataset.open(str(tmp_path / "back")).digest == dataset.digest, f"seed {seed}: {done}"
            shutil.rmtree(tmp_path / "back")
        shutil.rmtree(source)
