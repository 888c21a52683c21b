"""The precision in which a network drives: the fastest on this processor.

With products of bytes that are added in 32 bits (VNNI) that is int8. Without them it depends on the processor and on
the libraries, and is measured once and kept: on an AMD EPYC with AVX2 an image took 6 ms in int7, 15 in fp32, 130 in
bf16.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import lru_cache, partial
from pathlib import Path
from statistics import median
from time import perf_counter

import openvino
import torch

from caldrive.files import read_json, write_whole
from caldrive.perception.inference.engines import INTEGERS, PRECISIONS, backbone_engine, use_bf16
from caldrive.perception.network.backbone import Backbone
from caldrive.perception.network.config import NetworkConfig
from caldrive.user_cache import own_folders

CANDIDATES = ("int7", "fp32", "bf16")  # int8 overflows without VNNI
RUNS = 9
HOPELESS = 3.0  # times as slow as the fastest so far: not measured on


def driving_precision(wanted: str, ranges: Sequence[float]) -> str:
    """fp32, bf16, int8 or int7; `auto` is the fastest. ranges: the network's, without which (empty) there are no
    integers.

    Raises ValueError for another word, and for integers without ranges.
    """
    if wanted not in PRECISIONS:
        raise ValueError(f"found precision {wanted!r}, wanted one of {', '.join(PRECISIONS)}: type --precision auto")
    if wanted in INTEGERS and not ranges:
        raise ValueError("found a network without the ranges that int8 needs: train it again, or type --precision fp32")
    if wanted != "auto":
        return wanted
    if not ranges:
        return "bf16" if use_bf16(wanted, "cpu") else "fp32"
    return "int8" if has_vnni() else fastest_precision()


def has_vnni() -> bool:
    """Whether this processor adds products of bytes in 32 bits. One that adds pairs of them in 16 needs weights of 7
    bits: those of 8 would overflow."""
    return any(torch.cpu.get_capabilities().get(name) for name in ("avx512_vnni", "avx_vnni", "amx_int8"))


@lru_cache(maxsize=1)
def fastest_precision() -> str:
    """One of CANDIDATES, where there is no VNNI: from the user's cache, or measured in about a second."""
    for folder in own_folders():
        path = folder / f"fastest-{_machine()}.json"
        if (kept := _kept(path)) is not None:
            return kept
        times = measured()
        fastest = min(times, key=lambda name: times[name])
        with suppress(OSError):  # nothing can be kept there: another folder, or the next run measures again
            write_whole(path, json.dumps({"precision": fastest, "ms": times}).encode())
        return fastest
    times = measured()
    return min(times, key=lambda name: times[name])


def measured() -> dict[str, float]:
    """Milliseconds that an image takes through a backbone of the usual size, by precision; medians."""
    config = NetworkConfig()
    images = torch.rand(1, 3, *config.image_size, generator=torch.Generator().manual_seed(0))
    times: dict[str, float] = {}
    with torch.random.fork_rng([]), torch.inference_mode():  # a training may be under way
        for precision in CANDIDATES:
            backbone = Backbone(config.width, config.batch_norm).eval()
            ranges = (4.0,) * len(backbone.convolutions())
            engine = backbone_engine(precision, backbone, config.image_size, ranges, threads=1)
            times[precision] = _median_ms(partial(engine, images), min(times.values(), default=math.inf))
    return times


def _median_ms(run: Callable[[], object], fastest: float) -> float:
    """Of so many runs, after one to warm up; of one only where that is hopeless beside the fastest."""
    laps = list[float]()
    while len(laps) <= RUNS and not (len(laps) > 1 and laps[-1] > HOPELESS * fastest):
        start = perf_counter()
        run()
        laps.append(1000 * (perf_counter() - start))
    return round(median(laps[1:]), 3)


def _machine() -> str:
    """Tells this processor with these libraries from others."""
    about = (torch.cpu.get_capabilities(), torch.__version__, openvino.__version__)
    return hashlib.sha256(repr(about).encode()).hexdigest()[:16]


def _kept(path: Path) -> str | None:
    """What an earlier run found, None where there is none that can be read."""
    with suppress(OSError, ValueError, TypeError):
        precision = read_json(path.read_bytes(), dict).get("precision")
        return precision if precision in CANDIDATES else None
    return None
