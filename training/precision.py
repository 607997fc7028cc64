"""In which numbers a network computes: float32, or bfloat16 where the processor has matrix instructions for it.

Without them bfloat16 is slower than float32. The dot products of AVX-512 do not suffice: on a Xeon that has these and
no AMX ``train()`` got through 3,260 inputs a second in bfloat16 and 3,800 in float32 (RGB-D; depth 4,150 and 4,700).
"""

from __future__ import annotations

from typing import Literal, get_args

import torch

from handsight.training.errors import NetworkSettingsError

Precision = Literal["float32", "bfloat16", "auto"]
"""``auto`` is bfloat16 where that is faster, else float32: what it computes depends on the machine."""

_NATIVE_BFLOAT16 = ("amx_bf16", "bf16", "sve_bf16")
"""Names of the instruction sets that multiply matrices of bfloat16, of x86 and ARM, in the words of
``torch.cpu.get_capabilities``."""


def dtype_for(precision: Precision, device: torch.device) -> torch.dtype:
    """The type of the numbers that a network on ``device`` computes with.

    Raises:
        NetworkSettingsError: There is no such precision.
    """
    if precision not in get_args(Precision):
        raise NetworkSettingsError(f"precision is {precision!r}, expected one of: {', '.join(get_args(Precision))}")
    if precision == "auto":
        return torch.bfloat16 if multiplies_bfloat16(device) else torch.float32
    return torch.bfloat16 if precision == "bfloat16" else torch.float32


def multiplies_bfloat16(device: torch.device) -> bool:
    """Whether the processor behind ``device`` has instructions for products of matrices of bfloat16."""
    if device.type == "cuda":
        return bool(torch.cuda.is_bf16_supported(including_emulation=False))
    capabilities = torch.cpu.get_capabilities() if device.type == "cpu" else {}
    return any(bool(capabilities.get(name)) for name in _NATIVE_BFLOAT16)
