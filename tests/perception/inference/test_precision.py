"""In which precision a network drives."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
import torch

from caldrive.perception.inference import precision
from caldrive.perception.inference.precision import driving_precision, fastest_precision

RANGES = (1.0,) * 13


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """An empty cache on a processor without VNNI."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr("torch.cpu.get_capabilities", lambda: {"avx2": True})
    fastest_precision.cache_clear()
    yield tmp_path / "caldrive"
    fastest_precision.cache_clear()


def timed(monkeypatch: pytest.MonkeyPatch, **times: float) -> None:
    """Stands for a measurement."""
    monkeypatch.setattr(precision, "measured", lambda: times)


def test_with_products_of_bytes_in_32_bits_nothing_is_measured(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("torch.cpu.get_capabilities", lambda: {"avx512_vnni": True})
    assert driving_precision("auto", RANGES) == "int8"
    assert not home.exists()


def test_without_them_the_fastest_is_measured_once_and_kept(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    timed(monkeypatch, int7=6.0, fp32=5.0, bf16=90.0)
    assert driving_precision("auto", RANGES) == "fp32"
    timed(monkeypatch, int7=1.0, fp32=5.0, bf16=90.0)
    fastest_precision.cache_clear()  # another process
    assert driving_precision("auto", RANGES) == "fp32"
    (kept,) = home.iterdir()
    assert json.loads(kept.read_text()) == {"precision": "fp32", "ms": {"int7": 6.0, "fp32": 5.0, "bf16": 90.0}}


@pytest.mark.parametrize("text", ["", "{", "[]", '{"precision": "int4"}', '{"precision": 7}', "\xff"])
def test_what_is_kept_but_damaged_is_measured_again(home: Path, text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    timed(monkeypatch, int7=6.0, fp32=5.0)
    driving_precision("auto", RANGES)
    (kept,) = home.iterdir()
    kept.write_text(text)
    fastest_precision.cache_clear()
    assert driving_precision("auto", RANGES) == "fp32"
    assert json.loads(kept.read_text())["precision"] == "fp32"


def test_other_processors_and_libraries_are_measured_anew(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    timed(monkeypatch, int7=6.0, fp32=5.0)
    driving_precision("auto", RANGES)
    fastest_precision.cache_clear()
    monkeypatch.setattr("torch.cpu.get_capabilities", lambda: {"avx2": True, "cpu_name": "another"})
    timed(monkeypatch, int7=6.0, fp32=9.0)
    assert driving_precision("auto", RANGES) == "int7"
    assert len(list(home.iterdir())) == 2


def test_a_measurement_takes_each_candidate_and_leaves_chance_alone() -> None:
    torch.manual_seed(3)
    wanted = torch.rand(1)
    torch.manual_seed(3)
    times = precision.measured()
    assert torch.rand(1) == wanted
    assert list(times) == list(precision.CANDIDATES)
    assert min(times.values()) > 0


def test_eight_bits_need_ranges() -> None:
    assert driving_precision("fp32", RANGES) == "fp32"
    assert driving_precision("auto", ()) in ("fp32", "bf16")
    with pytest.raises(ValueError, match="ranges"):
        driving_precision("int8", ())
    with pytest.raises(ValueError, match="wanted one of auto, fp32, bf16, int8, int7"):
        driving_precision("int4", RANGES)
