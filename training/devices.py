"""Where networks are trained."""

from __future__ import annotations

import torch

from handsight.training.errors import TrainerSettingsError


def device_named(name: str) -> torch.device:
    """A device by the name that options have: ``cpu``, ``cuda``, or ``auto`` for a GPU where there is one.

    Raises:
        TrainerSettingsError: There is no GPU that this PyTorch can use.
    """
    found = torch.cuda.is_available()
    if name == "cuda" and not found:
        raise TrainerSettingsError(
            f"device is cuda, and PyTorch {torch.__version__} finds no GPU: install a driver and a PyTorch with CUDA, "
            "or train on cpu"
        )
    return torch.device("cuda" if name == "cuda" or (name == "auto" and found) else "cpu")
