"""Which numbers are computed with, on processors that are told apart by what they say of themselves."""

from __future__ import annotations

import pytest
import torch

from handsight.training.errors import NetworkSettingsError
from handsight.training.precision import dtype_for, multiplies_bfloat16

CPU = torch.device("cpu")


@pytest.mark.parametrize(
    ("capabilities", "native"),
    [
        ({"architecture": "x86_64", "avx2": True, "avx512_f": True, "avx512_bf16": False}, False),
        ({"architecture": "x86_64", "avx512_bf16": True, "amx_bf16": False}, False),
        ({"architecture": "x86_64", "avx512_bf16": True, "amx_bf16": False, "cpu_name": "Intel Xeon"}, False),
        ({"architecture": "x86_64", "avx512_bf16": True, "amx_bf16": False, "cpu_name": "AMD EPYC"}, True),
        ({"architecture": "x86_64", "avx512_bf16": False, "cpu_name": "AMD Ryzen 7 3700X"}, False),
        ({"architecture": "x86_64", "amx_bf16": True}, True),
        ({"architecture": "aarch64", "neon": True, "bf16": True}, True),
        ({}, False),
    ],
)
def test_auto_is_bfloat16_where_the_processor_multiplies_it(
    monkeypatch: pytest.MonkeyPatch, capabilities: dict[str, object], native: bool
) -> None:
    monkeypatch.setattr(torch.cpu, "get_capabilities", lambda: capabilities)
    assert multiplies_bfloat16(CPU) is native
    assert dtype_for("auto", CPU) == (torch.bfloat16 if native else torch.float32)
    assert (dtype_for("float32", CPU), dtype_for("bfloat16", CPU)) == (torch.float32, torch.bfloat16)


def test_a_precision_that_there_is_not_is_refused() -> None:
    with pytest.raises(NetworkSettingsError, match="precision is 'float16', expected one of: float32, bfloat16, auto"):
        dtype_for("float16", CPU)  # type: ignore[arg-type]
