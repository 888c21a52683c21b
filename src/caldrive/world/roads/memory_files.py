"""Files in memory, for programs that read and write files by their names: they need no folder and leave nothing."""

from __future__ import annotations

import os
from pathlib import Path
from typing import BinaryIO


def memory_file(content: bytes = b"") -> BinaryIO:
    """A file that is nowhere on a disk and ends when it is closed, with some content."""
    file = os.fdopen(os.memfd_create("caldrive"), "w+b")
    file.write(content)
    file.flush()
    return file


def path_of(file: BinaryIO) -> Path:
    """By which this process can open it, and one that it starts, to which it is passed on."""
    return Path(f"/proc/self/fd/{file.fileno()}")


def lasting_file(content: bytes) -> Path:
    """A file with some content in memory, for as long as this process lives and by its path."""
    with memory_file(content) as file:
        return Path(f"/proc/self/fd/{os.dup(file.fileno())}")
