"""What runs a network in each precision."""

from __future__ import annotations

import pytest
import torch

from caldrive.perception.inference.engines import use_bf16


def test_an_unknown_precision_is_named() -> None:
    with pytest.raises(ValueError, match="auto, fp32 or bf16"):
        use_bf16("int8", "cpu")


@pytest.mark.parametrize(
    ("capabilities", "faster"),
    [
        ({"cpu_name": "Intel Xeon", "avx512_bf16": True, "amx_bf16": False}, False),
        ({"cpu_name": "Intel Xeon", "avx512_bf16": True, "amx_bf16": True}, True),
        ({"cpu_name": "AMD EPYC", "avx512_bf16": True}, True),
        ({"architecture": "aarch64"}, False),
    ],
)
def test_bfloat16_is_used_where_it_is_faster(
    capabilities: dict[str, object], faster: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(torch.cpu, "get_capabilities", lambda: capabilities)
    assert use_bf16("auto", "cpu") is faster
    assert use_bf16("bf16", "cpu")
    assert use_bf16("auto", "cuda")
