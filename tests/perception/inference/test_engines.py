"""In which precision a network computes."""

from __future__ import annotations

import pytest
import torch

from caldrive.perception.inference.engines import driving_precision, use_bf16


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


@pytest.mark.parametrize(
    ("capabilities", "precision"), [({"avx512_vnni": True}, "int8"), ({"avx2": True}, "int7"), ({}, "fp32")]
)
def test_each_processor_drives_in_the_integers_that_it_adds_right(
    capabilities: dict[str, bool], precision: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("torch.cpu.get_capabilities", lambda: capabilities)
    assert driving_precision("auto", (1.0,) * 13) == precision


def test_eight_bits_need_ranges() -> None:
    without, with_ranges = (), (1.0,) * 13
    assert driving_precision("fp32", with_ranges) == "fp32"
    assert driving_precision("auto", without) in ("fp32", "bf16")
    with pytest.raises(ValueError, match="ranges"):
        driving_precision("int8", without)
    with pytest.raises(ValueError, match="wanted one of auto, fp32, bf16, int8, int7"):
        driving_precision("int4", with_ranges)
