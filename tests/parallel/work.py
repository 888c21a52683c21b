"""Work for other processes, which find it by its module: it squares a number, dies, or fails."""

from __future__ import annotations

import os
import signal
from pathlib import Path


def square(k: int) -> int:
    return k * k


def dies_at_first(folder: Path, k: int) -> int:
    """The square; but the process dies at the first try of every third number."""
    mark = folder / f"died-{k}"
    if k % 3 == 1 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return square(k)


def fails(k: int) -> int:
    raise ValueError(f"found {k}")
