"""In which numbers a network computes: float32, or bfloat16 where the processor is faster with it.

It is where there are instructions for matrices of bfloat16. Dot products of bfloat16 (AVX-512) alone are not enough to
tell by: on a Xeon that has these and no AMX ``train()`` got through 3,260 inputs a second in bfloat16 and 3,800 in
float32; on an EPYC of the fourth generation a step takes 29 ms in bfloat16 and 42 ms in float32 (RGB-D, 200 inputs).
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
_DOT_PRODUCTS, _FAST_WITH_THEM = "avx512_bf16", "AMD"
"""The dot products of AVX-512, and how the name of a processor begins that gains by them."""


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
    """Whether the processor behind ``device`` multiplies matrices of bfloat16 faster than those of float32."""
    if device.type == "cuda":
        return bool(torch.cuda.is_bf16_supported(including_emulation=False))
    capabilities = torch.cpu.get_capabilities() if device.type == "cpu" else {}
    if any(bool(capabilities.get(name)) for name in _NATIVE_BFLOAT16):
        return True
    maker = str(capabilities.get("cpu_name", ""))
    return bool(capabilities.get(_DOT_PRODUCTS)) and maker.startswith(_FAST_WITH_THEM)
