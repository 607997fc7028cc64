"""The Grasp Quality Network of section III-B: strided convolutions, then dense layers, one score.

The paper gives the activations (ELU after batch normalisation, SELU when dense) and the stride of 2, not the widths;
these come to 0.09 M parameters, so that 64 candidate poses take under ten milliseconds on one laptop core.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Self

import torch
from torch import Tensor, nn

from handsight.datasets.inputs.augmentation import InputForm
from handsight.training.errors import NetworkSettingsError

CHANNEL_SETS = {"rgbd": (0, 1, 2, 3), "rgb": (0, 1, 2), "depth": (3,)}
"""Which channels of a network input each variant of the ablation reads (section VI-B)."""

# Fixed normalisation: colours centred, heights of graspable things brought to order one. Statistics of a dataset would
# make a checkpoint depend on data that it does not name.
_COLOUR_CENTRE, _COLOUR_SCALE, _HEIGHT_SCALE_M = 0.5, 0.25, 0.03

MOST_LAYERS, WIDEST, LARGEST_KERNEL, LARGEST_INPUT_PX = 8, 4096, 31, 512
"""Largest networks that are built: a size that is off by some digits is refused before memory is asked for."""
MOST_PARAMETERS = 50_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class GqnConfig:
    """Shape of the network."""

    channels: str = "rgbd"
    """One of ``CHANNEL_SETS``."""
    widths: tuple[int, ...] = (16, 32, 48, 64)
    """Output channels of each convolution; every one has a stride of 2."""
    kernels: tuple[int, ...] = (5, 3, 3, 3)
    dense: tuple[int, ...] = (128, 64)
    size_px: int = 64
    """Side of the input picture."""
    padded: bool = False
    """Whether convolutions add a border of zeros, so that each exactly halves the picture. Without, what the network
    computes at a pixel does not depend on where a crop ends, and the crops of a picture share it (decision 023)."""

    def __post_init__(self) -> None:
        faults = []
        if self.channels not in CHANNEL_SETS:
            faults.append(f"channels is {self.channels!r}, expected one of: {', '.join(CHANNEL_SETS)}")
        faults += _list_faults("widths", self.widths, most=WIDEST)
        faults += _list_faults("kernels", self.kernels, most=LARGEST_KERNEL)
        faults += _list_faults("dense", self.dense, most=WIDEST)
        if not self.widths or len(self.widths) != len(self.kernels):
            faults.append(f"{len(self.widths)} widths and {len(self.kernels)} kernels, expected as many of each")
        padded: object = self.padded  # Perhaps from a file.
        if not isinstance(padded, bool):
            faults.append(f"padded is {padded!r}, expected true or false")
        few = len(self.kernels) <= MOST_LAYERS
        if few and self.padded and any(kernel % 2 == 0 for kernel in self.kernels if _is_whole(kernel)):
            faults.append(f"kernels are {self.kernels}, expected odd sizes, which a border keeps centred")
        if not (_is_whole(self.size_px) and 1 <= self.size_px <= LARGEST_INPUT_PX):
            faults.append(f"size_px is {self.size_px!r}, expected a whole number of 1 to {LARGEST_INPUT_PX}")
        else:
            faults += self._side_faults()
        if not faults and self.parameters > MOST_PARAMETERS:
            faults.append(f"the network has {self.parameters} parameters, expected at most {MOST_PARAMETERS}")
        if faults:
            raise NetworkSettingsError("; ".join(faults))

    def _side_faults(self) -> list[str]:
        """How a picture of an acceptable size does not suit the layers."""
        if max(len(self.widths), len(self.kernels)) > MOST_LAYERS or not all(_is_whole(k) for k in self.kernels):
            return []
        if self.padded:
            halved = 2 ** len(self.widths)
            return [f"size_px is {self.size_px}, expected a multiple of {halved}"] if self.size_px % halved else []
        side = self.size_px
        for at, (kernel, next_side) in enumerate(zip(self.kernels, self.sides[1:], strict=True), start=1):
            if next_side < 1:
                return [
                    f"size_px is {self.size_px}, which leaves {max(side, 0)} px to convolution {at} with its kernel of "
                    f"{kernel}, expected at least {kernel}: enlarge the picture, or have smaller kernels or fewer"
                ]
            side = next_side
        return []

    @property
    def sides(self) -> tuple[int, ...]:
        """Side of the picture before each convolution and after the last [px]; not positive where it is too small."""
        sides = [self.size_px]
        for kernel in self.kernels:
            sides.append((sides[-1] + 2 * self.border_px(kernel) - kernel) // 2 + 1)
        return tuple(sides)

    @property
    def reach_px(self) -> int:
        """How many pixels of a side the score depends on, from the first; strides can leave some at the end unread."""
        if self.padded:
            return self.size_px
        taps = [*self.kernels, self.sides[-1]]
        return 1 + sum((kernel - 1) << at for at, kernel in enumerate(taps))

    def border_px(self, kernel: int) -> int:
        """Width of the border of zeros that a convolution adds."""
        return kernel // 2 if self.padded else 0

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """What the network learns and keeps, by the names that it is stored under, known before it is built."""
        shapes: dict[str, tuple[int, ...]] = {}
        width = len(CHANNEL_SETS[self.channels])
        for at, (next_width, kernel) in enumerate(zip(self.widths, self.kernels, strict=True)):
            convolution, norm = f"features.{3 * at}", f"features.{3 * at + 1}"
            shapes[f"{convolution}.weight"] = (next_width, width, kernel, kernel)
            shapes |= {f"{norm}.{part}": (next_width,) for part in ("weight", "bias", "running_mean", "running_var")}
            shapes[f"{norm}.num_batches_tracked"] = ()
            width = next_width
        width *= self.sides[-1] ** 2
        for at, next_width in enumerate((*self.dense, 1)):
            shapes |= {f"head.{2 * at + 1}.weight": (next_width, width), f"head.{2 * at + 1}.bias": (next_width,)}
            width = next_width
        return shapes

    @property
    def parameters(self) -> int:
        """How many numbers the network learns."""
        return sum(math.prod(shape) for name, shape in self.shapes.items() if name.endswith(("weight", "bias")))

    def to_json(self) -> dict[str, Any]:
        """As JSON values."""
        return asdict(self)

    @classmethod
    def from_json(cls, values: dict[str, Any]) -> Self:
        """From what :meth:`to_json` gave, perhaps by way of a file.

        Where it is not said, convolutions are padded: all were before there was a choice.

        Raises:
            TypeError: There is a setting that this handsight does not know.
            NetworkSettingsError: The settings make no network.
        """
        # JSON has lists where the settings have tuples.
        settings: dict[str, Any] = {
            name: tuple(value) if isinstance(value, list) else value for name, value in values.items()
        }
        return cls(**{"padded": True, **settings})


def _is_whole(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _list_faults(name: str, sizes: Sequence[int], *, most: int) -> list[str]:
    if len(sizes) > MOST_LAYERS:
        return [f"there are {len(sizes)} {name}, expected at most {MOST_LAYERS}"]
    if not all(_is_whole(size) and 1 <= size <= most for size in sizes):
        return [f"{name} are {sizes}, expected whole numbers of 1 to {most}"]
    return []


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
                nn.Conv2d(width, next_width, kernel, stride=2, padding=config.border_px(kernel), bias=False),
                nn.BatchNorm2d(next_width),
                nn.ELU(inplace=True),
            ]
            width = next_width
        self.features = nn.Sequential(*layers)
        dense: list[nn.Module] = [nn.Flatten()]
        width *= config.sides[-1] ** 2
        for next_width in config.dense:
            dense += [_lecun(nn.Linear(width, next_width)), nn.SELU()]
            width = next_width
        self.head = nn.Sequential(*dense, nn.Linear(width, 1))
        shift = torch.tensor([_COLOUR_CENTRE] * 3 + [0.0])[self._picked]
        scale = torch.tensor([_COLOUR_SCALE] * 3 + [_HEIGHT_SCALE_M])[self._picked]
        self.register_buffer("shift", shift[:, None, None], persistent=False)
        self.register_buffer("scale", scale[:, None, None], persistent=False)

    @property
    def device(self) -> torch.device:
        """Where the weights are."""
        return self.get_buffer("shift").device

    def forward(self, inputs: Tensor) -> Tensor:
        """Logits for inputs as made by ``predict_inputs``. (B, 4, size, size) -> (B,)."""
        return self.logits_of(self._normalised(inputs))

    def logits_of(self, formed: Tensor) -> Tensor:
        """Logits for inputs that are in the network's form already. (B, C, reach, reach) -> (B,)."""
        logits: Tensor = self.head(self.features(formed))
        return logits[:, 0]

    def form(self, dtype: torch.dtype = torch.float32) -> InputForm:
        """In which form it reads inputs, to compute with numbers of some type."""
        shift, scale = (self.get_buffer(name).flatten().tolist() for name in ("shift", "scale"))
        return InputForm(
            size_px=self.config.reach_px, first=self._picked[0], shift=tuple(shift), scale=tuple(scale), dtype=dtype
        )

    def hidden(self, inputs: Tensor) -> Tensor:
        """What the last layer sees, of which it makes the logit. (B, 4, size, size) -> (B, D)."""
        layers: Tensor = self.head[:-1](self.features(self._normalised(inputs)))
        return layers

    def _normalised(self, inputs: Tensor) -> Tensor:
        """The channels and pixels that are read, of order one. (B, 4, size, size) -> (B, C, reach, reach)."""
        reach_px, first = self.config.reach_px, self._picked[0]
        read = inputs[:, first : first + len(self._picked), :reach_px, :reach_px]
        return (read - self.get_buffer("shift")) / self.get_buffer("scale")


def _lecun(layer: nn.Linear) -> nn.Linear:
    """The initialisation that SELU's self-normalisation assumes."""
    nn.init.normal_(layer.weight, std=layer.in_features**-0.5)
    nn.init.zeros_(layer.bias)
    return layer
