"""In which precision a network computes."""

from __future__ import annotations

import pytest
import torch

from caldrive.perception.inference.engines import driving_precision, use_bf16
from caldrive.perception.network.checkpoint import (
    CheckpointInfo,
)
from tests.perception.data import TINY


def test_an_unknown_precision_is_named() -> None:
    with pytest.raises(ValueError, match="auto, fp32 or bf16"):
        use_bf16("int8", "cpu")


@pytest.mark.parametrize(
    ("able", "pays"),
    [
        ({"cpu_name": "Intel Xeon", "avx512_bf16": True, "amx_bf16": False}, False),
        ({"cpu_name": "Intel Xeon", "avx512_bf16": True, "amx_bf16": True}, True),
        ({"cpu_name": "AMD EPYC", "avx512_bf16": True}, True),
        ({"architecture": "aarch64"}, False),
    ],
)
def test_bfloat16_is_used_where_it_is_faster(
    able: dict[str, object], pays: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(torch.cpu, "get_capabilities", lambda: able)
    assert use_bf16("auto", "cpu") is pays
    assert use_bf16("bf16", "cpu")
    assert use_bf16("auto", "cuda")


@pytest.mark.parametrize(("able", "wanted"), [({"avx512_vnni": True}, "int8"), ({"avx2": True}, "int7"), ({}, "fp32")])
def test_each_processor_drives_in_the_integers_that_it_adds_rightly(
    able: dict[str, bool], wanted: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("torch.cpu.get_capabilities", lambda: able)
    assert driving_precision("auto", CheckpointInfo(TINY, ranges=(1.0,) * 13)) == wanted


def test_eight_bits_need_ranges() -> None:
    without, known = CheckpointInfo(TINY), CheckpointInfo(TINY, ranges=(1.0,) * 13)
    assert driving_precision("fp32", known) == "fp32"
    assert driving_precision("auto", without) in ("fp32", "bf16")
    with pytest.raises(ValueError, match="ranges"):
        driving_precision("int8", without)
    with pytest.raises(ValueError, match="wanted one of auto, fp32, bf16, int8, int7"):
        driving_precision("int4", known)
