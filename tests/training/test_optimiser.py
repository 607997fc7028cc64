"""The optimiser is PyTorch's AdamW, and does not import its compiler."""

from __future__ import annotations

import copy
import subprocess
import sys
from pathlib import Path

import pytest
import torch
from torch import nn

from handsight.training.optimiser import AdamW

TESTS = Path(__file__).resolve().parents[1]
PREPARED = f"""
import sys, types
sys.modules["tests"] = types.ModuleType("tests")
sys.modules["tests"].__path__ = [{str(TESTS)!r}]
"""


def descend(network: nn.Module, optimiser: AdamW, *, steps: int) -> None:
    inputs = torch.rand(20, 5, generator=torch.Generator().manual_seed(1))
    for _ in range(steps):
        optimiser.forget_gradients()
        network(inputs).square().mean().backward()
        optimiser.step(0.01)


@pytest.fixture
def network() -> nn.Module:
    torch.manual_seed(0)
    return nn.Sequential(nn.Linear(5, 7), nn.ELU(), nn.Linear(7, 1))


def test_steps_are_those_of_pytorch(network: nn.Module) -> None:
    other = copy.deepcopy(network)
    descend(network, AdamW(network.parameters(), weight_decay=0.1), steps=4)
    expected = torch.optim.AdamW(other.parameters(), lr=0.01, weight_decay=0.1)
    inputs = torch.rand(20, 5, generator=torch.Generator().manual_seed(1))
    for _ in range(4):
        expected.zero_grad()
        other(inputs).square().mean().backward()
        expected.step()
    for weight, theirs in zip(network.parameters(), other.parameters(), strict=True):
        assert torch.equal(weight, theirs)


def test_it_goes_on_where_another_stood(network: nn.Module) -> None:
    whole = AdamW(network.parameters(), weight_decay=0.1)
    descend(network, whole, steps=2)
    other = copy.deepcopy(network)
    again = AdamW(other.parameters(), weight_decay=0.1)
    again.load_state({name: tensor.clone() for name, tensor in whole.state().items()})
    descend(network, whole, steps=2)
    descend(other, again, steps=2)
    for weight, resumed in zip(network.parameters(), other.parameters(), strict=True):
        assert torch.equal(weight, resumed)
    with pytest.raises(KeyError):
        again.load_state({})


def test_a_worker_that_trains_does_not_import_the_compiler() -> None:
    """Which takes as long as all of PyTorch does; nor SciPy, of which a cell would use one function."""
    program = (
        "import sys, torch\n"
        "from tests.support.drawn import SMALL, drawn_inputs\n"
        "import handsight.training.sweep.work\n"
        "from handsight.training.trainer import train\n"
        "train(drawn_inputs(40, seed=0), SMALL)\n"
        "print(sorted({'torch._dynamo', 'scipy', 'matplotlib'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-P", "-c", PREPARED + program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
