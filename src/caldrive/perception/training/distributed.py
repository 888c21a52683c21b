"""Where a network is trained: the device, the processes that share the work (torchrun starts one for each GPU), and
how each of them keeps its memory."""

from __future__ import annotations

import ctypes
import os
from dataclasses import dataclass

import torch
from torch import distributed

# What torchrun sets, with the values of a process on its own.
RANK, WORLD_SIZE, LOCAL_RANK = ("RANK", 0), ("WORLD_SIZE", 1), ("LOCAL_RANK", 0)

# What glibc's mallopt calls them, from its malloc.h.
TRIM_THRESHOLD, TOP_PAD, MMAP_THRESHOLD = -1, -2, -3
KEPT_BYTES = 2_000_000_000


@dataclass(frozen=True)
class ProcessGroup:
    """The processes that train one network, as one of them sees it: its device, its rank, and how many they are."""

    device: str = "cpu"
    rank: int = 0
    size: int = 1

    @property
    def is_main(self) -> bool:
        """Whether this process writes files and shows progress."""
        return self.rank == 0

    def barrier(self) -> None:
        """Waits until all processes are here."""
        if self.size > 1:
            distributed.barrier()


def join_process_group(device: str, batch: int) -> ProcessGroup:
    """The group that torchrun set up in the environment, or one process on its own.

    device: cpu, cuda, or auto for a GPU where there is one. Raises ValueError for a device that is not there, and for a
    batch that cannot be shared out evenly.
    """
    if device not in ("auto", "cpu", "cuda"):
        raise ValueError(f"found device {device!r}, wanted auto, cpu or cuda: type --device auto")
    if device == "cuda" and not torch.cuda.is_available():
        raise ValueError("found no GPU that torch can use, wanted one for --device cuda: type --device cpu")
    kind = "cuda" if device != "cpu" and torch.cuda.is_available() else "cpu"
    rank, size, local_rank = (int(os.environ.get(name, alone)) for name, alone in (RANK, WORLD_SIZE, LOCAL_RANK))
    if size == 1:
        return ProcessGroup(kind)
    if batch % size:
        raise ValueError(f"found {size} processes for a batch of {batch}, wanted equal shares: start another number")
    if kind == "cuda":  # NCCL works on the process' current device
        torch.cuda.set_device(local_rank)
    if not distributed.is_initialized():
        distributed.init_process_group("nccl" if kind == "cuda" else "gloo")
    return ProcessGroup(f"cuda:{local_rank}" if kind == "cuda" else kind, rank, size)


def keep_freed_memory() -> bool:
    """Makes malloc keep freed memory for the next step, which saves wiping it: on two cores a fifth of a step's time.

    From then on the whole process gives back no memory. Returns whether this system's malloc can do that; glibc's can
    from 2.35 on.
    """
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError, TypeError):  # not glibc
        return False
    settings = {MMAP_THRESHOLD: KEPT_BYTES, TRIM_THRESHOLD: KEPT_BYTES, TOP_PAD: KEPT_BYTES // 4}
    return all(mallopt(name, size) for name, size in settings.items())
