"""Several processes that train one network: together they find the gradient that one process would have found."""

from __future__ import annotations

import os
import socket
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path

import pytest
import torch

from caldrive.perception.network.checkpoint import read_tensors
from caldrive.perception.network.config import PerceptionConfig
from caldrive.perception.training.config import TrainingConfig
from caldrive.perception.training.distributed import Team, join
from caldrive.perception.training.train import train
from tests.perception.data import TINY, record

# Statistics of a batch, dropout and augmentation are each process' own: without them, shares of a batch add up exactly.
PLAIN = PerceptionConfig(**{
    name: replace(value, norm="none") if hasattr(value, "norm") else value for name, value in vars(TINY).items()
})  # fmt: skip
PLAIN = replace(PLAIN, batch_norm=False)
SHORT = TrainingConfig(
    steps=1, batch=4, warm_up=1, block_steps=0, evaluate_every=2, save_every=1, precision="fp32", augment=False,
    validation_share=0.3, device="cpu",
)  # fmt: skip


def _member(rank: int, port: int, data: Path, out: Path) -> None:
    os.environ |= {"RANK": str(rank), "WORLD_SIZE": "2", "LOCAL_RANK": str(rank)}
    os.environ |= {"MASTER_ADDR": "127.0.0.1", "MASTER_PORT": str(port)}
    torch.set_num_threads(1)
    train(SHORT, data, out, PLAIN)


def test_two_processes_find_the_gradient_that_one_finds(tmp_path: Path) -> None:
    data = record(tmp_path / "data")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    members = [get_context("spawn").Process(target=_member, args=(k, port, data, tmp_path / "two")) for k in range(2)]
    for member in members:
        member.start()
    train(SHORT, data, tmp_path / "one", PLAIN)
    for member in members:
        member.join(120)
    assert [member.exitcode for member in members] == [0, 0]
    one, two = (read_tensors(tmp_path / name / "state.safetensors")[0] for name in ("one", "two"))
    moments = [name for name in one if name.endswith("exp_avg")]  # a tenth of the gradient
    assert moments
    for name in moments:
        assert torch.allclose(one[name], two[name], rtol=1e-3, atol=1e-5), name
    assert max(float(one[name].abs().max()) for name in moments) > 1e-2


def test_one_process_is_a_team_of_its_own() -> None:
    assert join("cpu", 5) == Team("cpu", 0, 1)
    assert join("cpu", 5).leads


def test_a_device_that_is_not_there_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.raises(ValueError, match=r"no GPU that torch can use.* type --device cpu"):
        join("cuda", 4)
    with pytest.raises(ValueError, match="wanted auto, cpu or cuda"):
        join("tpu", 4)
    assert join("auto", 4).device == "cpu"


def test_a_batch_must_be_shared_out_evenly(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("WORLD_SIZE", "3")
    with pytest.raises(ValueError, match="3 processes for a batch of 4"):
        join("cpu", 4)
