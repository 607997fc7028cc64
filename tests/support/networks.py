"""Networks that tell inputs apart as trained ones do, but were never trained; and inputs to tell apart."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from handsight.training.gqn import GqnConfig, GraspQualityNetwork


def trained_looking(config: GqnConfig, *, seed: int = 0) -> GraspQualityNetwork:
    """A network in inference whose statistics are far from those it is built with; weights follow from the seed."""
    with torch.random.fork_rng(devices=()):
        torch.manual_seed(seed)
        network = GraspQualityNetwork(config)
        for layer in network.modules():
            if isinstance(layer, nn.BatchNorm2d):
                layer.running_mean = torch.randn(layer.num_features)
                layer.running_var = 0.5 + torch.rand(layer.num_features)
                nn.init.uniform_(layer.weight, 0.5, 1.5)
                nn.init.normal_(layer.bias, std=0.3)
            elif isinstance(layer, nn.Conv2d):
                # torch's own weights are so small that the scores of all inputs would be nearly the same.
                nn.init.kaiming_normal_(layer.weight, nonlinearity="relu")
        list(network.parameters())[-2].data.mul_(3)
    return network.eval()


def blobs(count: int, *, size_px: int = 64, seed: int = 1) -> Tensor:
    """Inputs with the coarse structure of pictures, heights within 5 cm. Shape (count, 4, size_px, size_px)."""
    coarse = torch.rand(count, 4, 5, 5, generator=torch.Generator().manual_seed(seed))
    inputs = functional.interpolate(coarse, size=size_px, mode="bilinear", align_corners=False)
    inputs[:, 3] = 0.05 * (2 * inputs[:, 3] - 1)
    return inputs
