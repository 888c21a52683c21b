"""Several processes that train one network: together they find the gradient that one process would have found."""

from __future__ import annotations

import os
import platform
import socket
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import pytest
import torch

from caldrive.affordances import SPECS
from caldrive.perception.dataset.config import AugmentationConfig
from caldrive.perception.network.tensor_file import read_tensors
from caldrive.perception.training.config import TrainingConfig
from caldrive.perception.training.distributed import ProcessGroup, join_process_group, keep_freed_memory
from caldrive.perception.training.train import train
from tests.perception.data import TINY, record

# Statistics of a batch, dropout and augmentation are each process' own: without them, shares of a batch add up exactly.
BLOCKS: dict[str, Any] = {spec.name: replace(getattr(TINY, spec.name), norm="none") for spec in SPECS}
PLAIN = replace(TINY, batch_norm=False, **BLOCKS)
ONE_STEP = TrainingConfig(
    steps=1, batch=4, warm_up=1, history_steps=0, evaluate_every=2, save_every=1, precision="fp32",
    augmentation=AugmentationConfig(enabled=False), validation_share=0.3, device="cpu",
)  # fmt: skip


def _process(rank: int, port: int, data: Path, out: Path) -> None:
    os.environ |= {"RANK": str(rank), "WORLD_SIZE": "2", "LOCAL_RANK": str(rank)}
    os.environ |= {"MASTER_ADDR": "127.0.0.1", "MASTER_PORT": str(port)}
    torch.set_num_threads(1)
    train(ONE_STEP, data, out, PLAIN)


def test_two_processes_find_the_gradient_that_one_finds(tmp_path: Path) -> None:
    data = record(tmp_path / "data")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    spawn, out = get_context("spawn"), tmp_path / "two"
    processes = [spawn.Process(target=_process, args=(rank, port, data, out)) for rank in range(2)]
    for process in processes:
        process.start()
    train(ONE_STEP, data, tmp_path / "one", PLAIN)
    for process in processes:
        process.join(120)
    assert [process.exitcode for process in processes] == [0, 0]
    alone, together = (read_tensors(tmp_path / name / "state.safetensors")[0] for name in ("one", "two"))
    moments = [name for name in alone if name.endswith("exp_avg")]  # a tenth of the gradient
    assert moments
    for name in moments:
        assert torch.allclose(alone[name], together[name], rtol=1e-3, atol=1e-5), name
    assert max(float(alone[name].abs().max()) for name in moments) > 1e-2


def test_one_process_is_a_group_of_its_own() -> None:
    assert join_process_group("cpu", 5) == ProcessGroup("cpu", 0, 1)
    assert join_process_group("cpu", 5).is_main


def test_a_device_that_is_not_there_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.raises(ValueError, match=r"no GPU that torch can use.* type --device cpu"):
        join_process_group("cuda", 4)
    with pytest.raises(ValueError, match="wanted auto, cpu or cuda"):
        join_process_group("tpu", 4)
    assert join_process_group("auto", 4).device == "cpu"


def test_a_batch_must_be_shared_out_evenly(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("WORLD_SIZE", "3")
    with pytest.raises(ValueError, match="3 processes for a batch of 4"):
        join_process_group("cpu", 4)


def test_memory_is_kept_where_the_system_can() -> None:
    name, version = platform.libc_ver()
    if name == "glibc" and tuple(map(int, version.split("."))) < (2, 35):
        pytest.skip("glibc's malloc kept blocks of 32 MiB at most before 2.35")
    assert keep_freed_memory() is (name == "glibc")
