"""The Grasp Quality Network of section III-B: strided convolutions, then dense layers, one score.

The paper gives the activations (ELU after batch normalisation, SELU when dense) and the stride of 2, not the widths;
these come to 0.19 M parameters, so that 64 candidate poses take about ten milliseconds on one laptop core.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Self

import torch
from torch import Tensor, nn

from handsight.training.errors import NetworkSettingsError

CHANNEL_SETS = {"rgbd": (0, 1, 2, 3), "rgb": (0, 1, 2), "depth": (3,)}
"""Which channels of a network input each variant of the ablation reads (section VI-B)."""

# Fixed normalisation: colours centred, heights of graspable things brought to order one. Statistics of a dataset would
# make a checkpoint depend on data that it does not name.
_COLOUR_CENTRE, _COLOUR_SCALE, _HEIGHT_SCALE_M = 0.5, 0.25, 0.03


@dataclass(frozen=True, slots=True, kw_only=True)
class GqnConfig:
    """Shape of the network."""

    channels: str = "rgbd"
    """One of ``CHANNEL_SETS``."""
    widths: tuple[int, ...] = (16, 32, 48, 64)
    """Output channels of each convolution; every one halves the picture."""
    kernels: tuple[int, ...] = (5, 3, 3, 3)
    dense: tuple[int, ...] = (128, 64)
    size_px: int = 64
    """Side of the input picture."""

    def __post_init__(self) -> None:
        faults = []
        if self.channels not in CHANNEL_SETS:
            faults.append(f"channels is {self.channels!r}, expected one of: {', '.join(CHANNEL_SETS)}")
        if not self.widths or len(self.widths) != len(self.kernels):
            faults.append(f"{len(self.widths)} widths and {len(self.kernels)} kernels, expected as many of each")
        if any(kernel % 2 == 0 for kernel in self.kernels):
            faults.append(f"kernels are {self.kernels}, expected odd sizes")
        if self.size_px % 2 ** len(self.widths):
            faults.append(f"size_px is {self.size_px}, expected a multiple of {2 ** len(self.widths)}")
        if faults:
            raise NetworkSettingsError("; ".join(faults))

    def to_json(self) -> dict[str, Any]:
        """As JSON values."""
        return asdict(self)

    @classmethod
    def from_json(cls, values: dict[str, Any]) -> Self:
        """From what :meth:`to_json` gave, perhaps by way of a file.

        Raises:
            TypeError: There is a setting that this handsight does not know.
            NetworkSettingsError: The settings make no network.
        """
        # JSON has lists where the settings have tuples.
        settings: dict[str, Any] = {
            name: tuple(value) if isinstance(value, list) else value for name, value in values.items()
        }
        return cls(**settings)


class GraspQualityNetwork(nn.Module):
    """Maps network inputs to the logit of the predicted grasp success S."""

    def __init__(self, config: GqnConfig) -> None:
        """Fresh weights from torch's current random state."""
        super().__init__()
        self.config = config
        picked = CHANNEL_SETS[config.channels]
        self._picked = list(picked)
        layers: list[nn.Module] = []
        width = len(picked)
        for next_width, kernel in zip(config.widths, config.kernels, strict=True):
            layers += [
                nn.Conv2d(width, next_width, kernel, stride=2, padding=kernel // 2, bias=False),
                nn.BatchNorm2d(next_width),
                nn.ELU(),
            ]
            width = next_width
        self.features = nn.Sequential(*layers)
        size = config.size_px // 2 ** len(config.widths)
        dense: list[nn.Module] = [nn.Flatten()]
        width *= size * size
        for next_width in config.dense:
            dense += [_lecun(nn.Linear(width, next_width)), nn.SELU()]
            width = next_width
        self.head = nn.Sequential(*dense, nn.Linear(width, 1))
        shift = torch.tensor([_COLOUR_CENTRE] * 3 + [0.0])[self._picked]
        scale = torch.tensor([_COLOUR_SCALE] * 3 + [_HEIGHT_SCALE_M])[self._picked]
        self.register_buffer("shift", shift[:, None, None], persistent=False)
        self.register_buffer("scale", scale[:, None, None], persistent=False)

    def forward(self, inputs: Tensor) -> Tensor:
        """Logits for inputs as made by ``predict_inputs``. (B, 4, size, size) -> (B,)."""
        x = (inputs[:, self._picked] - self.get_buffer("shift")) / self.get_buffer("scale")  # (B, C, size, size)
        logits: Tensor = self.head(self.features(x))
        return logits[:, 0]


def _lecun(layer: nn.Linear) -> nn.Linear:
    """The initialisation that SELU's self-normalisation assumes."""
    nn.init.normal_(layer.weight, std=layer.in_features**-0.5)
    nn.init.zeros_(layer.bias)
    return layer


class Scorer:
    """A trained network as the servo loop wants it: inputs in, success metrics S in [0, 1] out."""

    def __init__(self, network: GraspQualityNetwork) -> None:
        """Switch ``network`` to inference."""
        self._network = network.eval()

    def __call__(self, inputs: Tensor) -> Tensor:
        """(B, 4, size, size) -> (B,)."""
        with torch.inference_mode():
            return torch.sigmoid(self._network(inputs))
