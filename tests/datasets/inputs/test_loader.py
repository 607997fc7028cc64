"""From a version to shuffled batches: the right rows, the same order everywhere, resumed in the middle."""

from __future__ import annotations

import json
import pickle
from itertools import chain, islice
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
import torch
from tests.support.factories import make_attempt, make_header, record
from torch.utils.data import DataLoader

from handsight.datasets import GraspDataset, GraspRepository, LoaderStateError, NoTrainingDataError
from handsight.datasets.curation.curator import Curator
from handsight.datasets.inputs.augmentation import FLIPS
from handsight.datasets.inputs.loader import GraspLoader, epoch_order
from handsight.datasets.inputs.materialize import GraspInputs, grasp_input, materialize
from handsight.datasets.inputs.torch_dataset import FlippedGrasps, TorchGrasps
from handsight.datasets.reading.selection import Selection
from handsight.servoing.homography import InputGrid
from handsight.servoing.planar import PlanarPose

SIZE = 50


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> GraspDataset:
    """Sixty attempts with pictures just large enough for the crop."""
    repository = GraspRepository.create(tmp_path_factory.mktemp("inputs") / "grasps")
    header = make_header(width=64, height=48)
    record(repository, header, [make_attempt(header, number) for number in range(60)], every=60)
    Curator(repository, author="jo").exclude(Selection(where="number == 3 or outcome == 'held'"), "test")
    return GraspDataset.open(str(repository.path))


GRID = InputGrid(crop_px=40, size_px=8)


def test_every_input_is_the_warp_of_its_own_attempt(dataset: GraspDataset) -> None:
    made: list[int] = []
    data = materialize(dataset, viewpoint="overhead", grid=GRID, on_attempt=lambda: made.append(1))
    table = dataset.attempts
    wanted = table["overhead_taken"] & table["success"].notna() & ~table["excluded"]
    assert data.attempts.index.tolist() == table.index[wanted].tolist()
    assert 0 < len(data.inputs) == len(made) < wanted.size
    for row, (identity, facts) in enumerate(data.attempts.iterrows()):
        goal = PlanarPose(x_m=facts["pregrasp_x_m"], y_m=facts["pregrasp_y_m"], angle_rad=facts["pregrasp_angle_rad"])
        frame = dataset.frame(str(identity), "overhead")
        expected = grasp_input(frame, dataset.station(str(identity)), goal, GRID).astype(np.float16)
        np.testing.assert_array_equal(data.inputs[row], expected)


def test_the_cache_is_used_and_follows_curation(dataset: GraspDataset) -> None:
    first = materialize(dataset, grid=GRID)
    again: list[int] = []
    second = materialize(dataset, grid=GRID, on_attempt=lambda: again.append(1))
    assert again == []
    np.testing.assert_array_equal(first.inputs, second.inputs)
    curator = Curator(dataset.repository, author="jo")
    curator.exclude(Selection(ids=(first.attempts.index[0],)), "dark")
    curator.relabel(Selection(ids=(first.attempts.index[1],)), True, "held after all")
    curated = materialize(GraspDataset(dataset.repository, ref="main"), grid=GRID)
    assert curated.attempts.index.tolist() == first.attempts.index[1:].tolist()
    np.testing.assert_array_equal(curated.inputs, first.inputs[1:])
    assert (first.labels[1], curated.labels[0]) == (0, 1)


@pytest.mark.parametrize("damage", ["flipped", "short", "foreign", "empty", "of an older handsight"])
def test_a_cache_that_is_not_what_was_written_is_made_again(dataset: GraspDataset, damage: str) -> None:
    first = materialize(dataset, grid=GRID)
    assert first.file is not None
    expected, whole = np.array(first.inputs), first.file.read_bytes()
    spoilt = bytearray(whole)
    if damage == "flipped":
        spoilt[len(whole) // 2] ^= 4
    elif damage == "foreign":
        other = materialize(dataset, viewpoint="pregrasp", grid=GRID).file
        assert other is not None
        spoilt = bytearray(other.read_bytes())
    else:
        del spoilt[{"short": len(whole) // 2, "empty": 0, "of an older handsight": len(whole) - 32}[damage] :]
    first.file.write_bytes(spoilt)
    made: list[int] = []
    again = materialize(dataset, grid=GRID, on_attempt=lambda: made.append(1))
    assert len(made) == len(expected)
    np.testing.assert_array_equal(again.inputs, expected)
    assert first.file.read_bytes() == whole


def test_a_worker_notices_a_file_that_is_no_longer_the_one_it_was_promised(inputs: GraspInputs, tmp_path: Path) -> None:
    path = tmp_path / "inputs.npy"
    np.save(path, inputs.inputs)
    pickled = pickle.dumps(TorchGrasps(GraspInputs(inputs=np.load(path, mmap_mode="r"), attempts=inputs.attempts)))
    np.save(path, np.asarray(inputs.inputs)[:, :, :1])
    with pytest.raises(OSError, match="expected float16 of shape"):
        pickle.loads(pickled)
    path.write_bytes(b"\x93NUMPY")
    with pytest.raises(OSError, match="is no array of inputs"):
        pickle.loads(pickled)


def test_nothing_to_learn_from_is_said(repository: GraspRepository) -> None:
    with pytest.raises(NoTrainingDataError, match="no labelled attempt"):
        materialize(GraspDataset(repository, ref="main"))


@pytest.fixture(scope="module")
def inputs(dataset: GraspDataset, tmp_path_factory: pytest.TempPathFactory) -> GraspInputs:
    """Inputs that say which they are, mapped from a file."""
    path = tmp_path_factory.mktemp("mapped") / "inputs.npy"
    np.save(path, np.broadcast_to(np.arange(SIZE, dtype=np.float16)[:, None, None, None], (SIZE, 4, 2, 2)))
    success = np.arange(SIZE) % 3 == 0
    attempts = dataset.attempts.iloc[:SIZE].assign(success=success)
    return GraspInputs(inputs=np.load(path, mmap_mode="r"), attempts=attempts)


def names(batches: Any) -> list[list[int]]:
    """Which samples batches hold; checks that their labels belong to them."""
    found = []
    for batch, labels in batches:
        which = batch[:, 0, 0, 0].to(torch.int64)
        assert torch.equal(labels, (which % 3 == 0).to(torch.float32))
        found.append(which.tolist())
    return found


def test_single_samples_collate(inputs: GraspInputs) -> None:
    dataset = TorchGrasps(inputs)
    one, label = dataset[7]
    assert (one.shape, one.dtype, float(one[0, 0, 0]), float(label)) == ((4, 2, 2), torch.float16, 7, 0)
    assert names(DataLoader(dataset, batch_size=20)) == [list(range(20)), list(range(20, 40)), list(range(40, 50))]


def test_a_pickled_dataset_names_the_file_and_holds_no_pictures(inputs: GraspInputs) -> None:
    dataset = TorchGrasps(inputs)
    assert b"inputs.npy" in pickle.dumps(dataset)
    assert inputs.inputs.tobytes()[:64] not in pickle.dumps(dataset)
    copy = pickle.loads(pickle.dumps(dataset))
    assert torch.equal(copy[[3, 1]][0], dataset[[3, 1]][0])
    in_memory = GraspInputs(inputs=np.array(inputs.inputs), attempts=inputs.attempts)
    assert torch.equal(pickle.loads(pickle.dumps(TorchGrasps(in_memory)))[[3]][0], dataset[[3]][0])


def test_pickled_inputs_name_their_file_and_hold_no_pictures(inputs: GraspInputs) -> None:
    pickled = pickle.dumps(inputs)
    assert inputs.inputs.tobytes()[:64] not in pickled
    again = pickle.loads(pickled)
    assert again.file == inputs.file
    np.testing.assert_array_equal(again.inputs, inputs.inputs)
    assert again.attempts.equals(inputs.attempts)
    in_memory = pickle.loads(pickle.dumps(GraspInputs(inputs=np.array(inputs.inputs), attempts=inputs.attempts)))
    assert in_memory.file is None
    np.testing.assert_array_equal(in_memory.inputs, inputs.inputs)


def test_an_epoch_has_every_row_once_and_its_own_order(inputs: GraspInputs) -> None:
    loader = GraspLoader(TorchGrasps(inputs), batch_size=8, seed=5)
    epochs = [names(loader) for _ in range(3)]
    assert len(loader) == 7
    for epoch in epochs:
        assert [len(batch) for batch in epoch] == [8] * 6 + [2]
        assert sorted(chain.from_iterable(epoch)) == list(range(SIZE))
    assert epochs[0] != epochs[1] != epochs[2]
    assert list(chain.from_iterable(epochs[1])) == epoch_order(SIZE, seed=5, epoch=1).tolist()
    assert names(GraspLoader(TorchGrasps(inputs), batch_size=8, seed=6)) != epochs[0]


@pytest.mark.parametrize(("workers", "method"), [(1, "spawn"), (2, "forkserver"), (2, "fork")])
def test_the_order_is_the_same_for_any_workers(
    dataset: GraspDataset, inputs: GraspInputs, workers: int, method: Literal["fork", "forkserver", "spawn"]
) -> None:
    """Forked workers too, in a process that has an Icechunk store open."""
    assert dataset.info().attempts == 60
    rows = np.arange(0, SIZE, 2)
    alone = names(GraspLoader(TorchGrasps(inputs), batch_size=8, seed=1, rows=rows))
    several = GraspLoader(TorchGrasps(inputs), batch_size=8, seed=1, rows=rows, workers=workers, start_method=method)
    assert names(several) == alone
    assert sorted(chain.from_iterable(alone)) == rows.tolist()


@pytest.mark.parametrize("workers", [0, 1])
@pytest.mark.parametrize("delivered", [0, 1, 6, 7, 10])
def test_a_loader_goes_on_where_another_stopped(inputs: GraspInputs, delivered: int, workers: int) -> None:
    def loader() -> GraspLoader:
        return GraspLoader(TorchGrasps(inputs), batch_size=8, seed=5, workers=workers, start_method="fork")

    def stream(source: GraspLoader) -> Any:
        while True:
            yield from names_one_by_one(source)

    def names_one_by_one(source: GraspLoader) -> Any:
        for batch in source:
            yield names([batch])[0]

    whole = list(islice(stream(loader()), 16))
    first = loader()
    before = list(islice(stream(first), delivered))
    state = json.loads(json.dumps(first.state_dict()))
    second = loader()
    second.load_state_dict(state)
    assert before + list(islice(stream(second), 16 - delivered)) == whole


def test_a_state_of_other_batches_is_refused(inputs: GraspInputs) -> None:
    state = GraspLoader(TorchGrasps(inputs), batch_size=8, seed=5).state_dict()
    other = GraspLoader(TorchGrasps(inputs), batch_size=4, seed=6, rows=np.arange(40))
    with pytest.raises(LoaderStateError, match=r"seed was 5, now 6; batch_size was 8, now 4; rows was 50, now 40"):
        other.load_state_dict(state)
    with pytest.raises(LoaderStateError, match="batch 99"):
        GraspLoader(TorchGrasps(inputs), batch_size=8, seed=5).load_state_dict({**state, "batch": 99})
    assert other.epoch == 0


def flipped_names(batches: Any) -> list[list[tuple[int, int]]]:
    """Which attempt in which flip batches hold, told from a number in a corner; checks that labels belong to them."""
    found = []
    for batch, labels in batches:
        which = batch.flatten(1).max(1).values.to(torch.int64)
        assert torch.equal(labels, (which % 3 == 0).to(torch.float32))
        found.append(list(zip(which.tolist(), batch[:, 0].flatten(1).argmax(1).tolist(), strict=True)))
    return found


@pytest.fixture
def cornered(inputs: GraspInputs, tmp_path: Path) -> GraspInputs:
    """Inputs that are -1 but for the number of their attempt in the first corner."""
    pictures = np.full((SIZE, 4, 2, 2), -1, np.float16)
    pictures[..., 0, 0] = np.arange(SIZE)[:, None]
    np.save(tmp_path / "cornered.npy", pictures)
    return GraspInputs(inputs=np.load(tmp_path / "cornered.npy", mmap_mode="r"), attempts=inputs.attempts)


def test_flipped_grasps_have_every_attempt_in_all_flips(cornered: GraspInputs) -> None:
    dataset = FlippedGrasps(cornered)
    assert len(dataset) == FLIPS * SIZE
    # The corner goes to the right, to the bottom, and to both.
    assert flipped_names([dataset[range(20, 24)]]) == [[(5, 0), (5, 1), (5, 2), (5, 3)]]
    one, label = dataset[22]
    assert (one.shape, one.dtype, float(label)) == ((4, 2, 2), torch.float16, 0)
    assert torch.equal(one, dataset[[22]][0][0])
    assert FlippedGrasps.positions(np.array([5, 2])).tolist() == [20, 21, 22, 23, 8, 9, 10, 11]
    assert torch.equal(pickle.loads(pickle.dumps(dataset))[[22, 3]][0], dataset[[22, 3]][0])


@pytest.mark.parametrize(("workers", "method"), [(1, "spawn"), (2, "forkserver"), (2, "fork")])
def test_an_epoch_of_flipped_grasps_is_the_same_for_any_workers(
    cornered: GraspInputs, workers: int, method: Literal["fork", "forkserver", "spawn"]
) -> None:
    attempts = np.arange(0, SIZE, 2)
    rows = FlippedGrasps.positions(attempts)
    loader = GraspLoader(FlippedGrasps(cornered), batch_size=16, seed=1, rows=rows)
    several = GraspLoader(
        FlippedGrasps(cornered), batch_size=16, seed=1, rows=rows, workers=workers, start_method=method
    )
    alone = flipped_names(loader)
    assert flipped_names(several) == alone
    assert sorted(chain.from_iterable(alone)) == [
        (attempt, flip) for attempt in attempts.tolist() for flip in range(FLIPS)
    ]
    assert flipped_names(loader) != alone


@pytest.mark.parametrize("wrong", [{"batch_size": 0}, {"seed": -1}, {"workers": -1}, {"rows": np.array([50])}])
def test_settings_out_of_range_are_refused(inputs: GraspInputs, wrong: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="expected"):
        GraspLoader(TorchGrasps(inputs), **{"batch_size": 8, "seed": 0, **wrong})


def test_a_dataset_of_some_rows_of_a_file_is_refused_in_a_worker(inputs: GraspInputs, tmp_path: Path) -> None:
    some = GraspInputs(inputs=inputs.inputs[:10], attempts=inputs.attempts.iloc[:10])
    with pytest.raises(OSError, match="50 inputs, expected 10"):
        pickle.loads(pickle.dumps(TorchGrasps(some)))
