"""Small datasets and sweeps over them."""

from __future__ import annotations

from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

from tests.support.factories import make_attempt, make_header, record

from handsight.datasets import GraspDataset, GraspRepository, Outcome
from handsight.training.course import Epoch
from handsight.training.gqn import GqnConfig
from handsight.training.metrics import Metrics
from handsight.training.settings import TrainSettings
from handsight.training.sweep.cell import Cell
from handsight.training.sweep.plan import SweepPlan
from handsight.training.sweep.prepare import plan_sweep
from handsight.training.sweep.result import CellResult, ObjectScore, Prediction

OBJECTS = ("apple", "cup", "duck", "egg", "fork", "jar")
RECIPE = TrainSettings(
    network=GqnConfig(widths=(4, 4), kernels=(3, 3), dense=(8,), size_px=16), epochs=2, least_epochs=1, batch=16
)
"""A network that is trained in a moment."""
CELL = Cell(dataset=0, channels="rgb", size=5, trial=0, varied=(("mixup", "0"),))
HELD_OUT = Metrics(attempts=9, accuracy=0.75, auc=0.9, loss=0.5)
RESULT = CellResult(
    tested=HELD_OUT,
    predictions=(Prediction(attempt="a-1", group="cup", success=True, score=0.75),),
    objects={"cup": ObjectScore(attempts=4, correct=3)},
    curve=(Epoch(number=1, train_loss=0.5, held_out=HELD_OUT), Epoch(number=2, train_loss=0.4, held_out=HELD_OUT)),
    epochs=2,
    kept_epoch=1,
    trained_on=5,
    held_out_attempts=10,
    pool=40,
    seconds=1.5,
    processor_s=1.25,
)
"""What became of that cell."""


def make_swept(path: Path, *, attempts: int = 60, seed: int = 1) -> str:
    """Grasps at six objects, of which every third holds."""
    header = make_header(seed=seed, objects=OBJECTS)
    outcomes = [Outcome.HELD if at % 3 == 0 else Outcome.EMPTY for at in range(attempts)]
    made = [make_attempt(header, at, outcome=outcome) for at, outcome in enumerate(outcomes)]
    record(GraspRepository.create(path), header, made, every=attempts)
    return str(path)


def swept_plan(*addresses: str, **changes: object) -> SweepPlan:
    """A plan of two channel sets, two sizes and three trials, but for what is changed."""
    axes: dict[str, object] = {
        "viewpoint": "overhead",
        "channels": ("rgb", "depth"),
        "sizes": (12, 20),
        "trials": 3,
        "by": "object",
        "held_out": 0.34,
        "seed": 0,
        "varied": {},
        "recipe": RECIPE,
    }
    return plan_sweep({address: GraspDataset.open(address) for address in addresses}, **{**axes, **changes})  # type: ignore[arg-type]


@dataclass
class Threads:
    """An engine in this process, which counts its workers."""

    started: int = field(default=0)

    def start_worker(self) -> Executor:
        self.started += 1
        return ThreadPoolExecutor(1)

    def kill_worker(self, worker: Executor) -> None:
        """A thread cannot be killed: its cell is waited for."""
