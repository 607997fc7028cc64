"""AdamW over the weights of one network (Loshchilov and Hutter 2019, Decoupled weight decay regularization).

The steps are PyTorch's. Its class of that name imports PyTorch's compiler when it is made, which takes as long as all
of PyTorch does: half of what a worker needs before it can begin.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import torch
from torch import Tensor
from torch.optim.adamw import adamw

_HELD = ("exp_avg", "exp_avg_sq", "step")
"""What is known of every weight, by PyTorch's names: running means of its gradient and of the square, and steps."""
_BETAS, _EPSILON = (0.9, 0.999), 1e-8


class AdamW:
    """The optimiser, and the moments that it keeps.

    Args:
        weights: What is learnt; they stay where they are.
        weight_decay: Share of a weight that goes with each unit of the learning rate.
    """

    def __init__(self, weights: Iterable[Tensor], *, weight_decay: float) -> None:
        self._weights = list(weights)
        self._weight_decay = weight_decay
        means, squares = ([torch.zeros_like(weight) for weight in self._weights] for _ in range(2))
        self._held: dict[str, list[Tensor]] = {
            "exp_avg": means,
            "exp_avg_sq": squares,
            "step": [torch.zeros(()) for _ in self._weights],
        }

    def forget_gradients(self) -> None:
        """Before those of another batch are computed."""
        for weight in self._weights:
            weight.grad = None

    @torch.no_grad()
    def step(self, learning_rate: float) -> None:
        """Move every weight against its gradient."""
        means, squares, steps = (self._held[name] for name in _HELD)
        adamw(
            self._weights,
            [weight.grad for weight in self._weights if weight.grad is not None],
            means,
            squares,
            [],
            steps,
            foreach=True,
            amsgrad=False,
            beta1=_BETAS[0],
            beta2=_BETAS[1],
            lr=learning_rate,
            weight_decay=self._weight_decay,
            eps=_EPSILON,
            maximize=False,
        )

    def state(self) -> dict[str, Tensor]:
        """All that the next steps depend on beside the weights, by name; not copied."""
        return {f"{at}.{name}": held[at] for name, held in self._held.items() for at in range(len(self._weights))}

    def load_state(self, state: Mapping[str, Tensor]) -> None:
        """Go on where the optimiser that gave the state stood.

        Raises:
            KeyError, RuntimeError: It is that of another network.
        """
        for name, tensor in self.state().items():
            tensor.copy_(state[name])
