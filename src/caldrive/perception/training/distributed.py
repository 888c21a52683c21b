"""Where a network is trained: on which device, and with which other processes (torchrun starts one for each GPU)."""

from __future__ import annotations

import ctypes
import os
from dataclasses import dataclass

import torch
from torch import distributed


@dataclass(frozen=True)
class Team:
    """This process among those that train one network: its number, how many they are, and its device."""

    device: str = "cpu"
    rank: int = 0
    size: int = 1

    @property
    def leads(self) -> bool:
        """Whether this process writes files and shows progress."""
        return self.rank == 0

    def wait(self) -> None:
        """Until all processes are here."""
        if self.size > 1:
            distributed.barrier()


def join(device: str, batch: int) -> Team:
    """The team that torchrun set up in the environment, or one process on its own.

    device: cpu, cuda, or auto for a GPU where there is one. Raises ValueError for a device that is not there, and for a
    batch that cannot be shared out evenly.
    """
    if device not in ("auto", "cpu", "cuda"):
        raise ValueError(f"found device {device!r}, wanted auto, cpu or cuda: type --device auto")
    if device == "cuda" and not torch.cuda.is_available():
        raise ValueError("found no GPU that torch can use, wanted one for --device cuda: type --device cpu")
    kind = "cuda" if device != "cpu" and torch.cuda.is_available() else "cpu"
    rank, size, local = (int(os.environ.get(name, value)) for name, value in _TORCHRUN)
    if size == 1:
        return Team(kind)
    if batch % size:
        raise ValueError(f"found {size} processes for a batch of {batch}, wanted equal shares: start another number")
    if kind == "cuda":  # NCCL works on the process' current device
        torch.cuda.set_device(local)
    if not distributed.is_initialized():
        distributed.init_process_group("nccl" if kind == "cuda" else "gloo")
    return Team(f"cuda:{local}" if kind == "cuda" else kind, rank, size)


_TORCHRUN = (("RANK", "0"), ("WORLD_SIZE", "1"), ("LOCAL_RANK", "0"))

# What glibc's mallopt calls them, from its malloc.h.
TRIM_THRESHOLD, TOP_PAD, MMAP_THRESHOLD = -1, -2, -3
KEPT = 2_000_000_000  # bytes


def keep_memory() -> bool:
    """Keep freed blocks for the next step, which saves wiping them: on two cores a fifth of a step's time.

    From then on the whole process gives back no memory. Returns whether this system's malloc can do that; glibc's can
    from 2.35 on.
    """
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError, TypeError):  # not glibc
        return False
    wanted = {MMAP_THRESHOLD: KEPT, TRIM_THRESHOLD: KEPT, TOP_PAD: KEPT // 4}
    return all(mallopt(name, size) for name, size in wanted.items())
