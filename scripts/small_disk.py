"""A small disk that can be filled up."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from scripts.attack.attempt import fresh
from scripts.attack.runner import Limits

DISK = 64_000_000  # bytes, many times what is written


class SmallDisk:
    """A folder on a disk of its own, where one may mount one."""

    def __init__(self, folder: Path) -> None:
        self.mount = fresh(folder).resolve()
        self.path = self.mount / "here"
        options = ["-t", "tmpfs", "-o", f"size={DISK}", "tmpfs", str(self.mount)]
        self.mounted = subprocess.run(["mount", *options], capture_output=True, check=False).returncode == 0

    def __enter__(self) -> SmallDisk:
        return self

    def __exit__(self, *_: object) -> None:
        if self.mounted:
            subprocess.run(["umount", "--lazy", str(self.mount)], check=False)

    def emptied(self) -> Path:
        return fresh(self.path)

    @contextmanager
    def almost_full(self, free: int) -> Iterator[Limits]:
        """A block in which so many bytes are free; gives the limits under which a child then runs."""
        if not self.mounted:
            yield Limits(file_size=free)
            return
        filler = self.mount / "filler"
        filler.write_bytes(bytes(max(0, shutil.disk_usage(self.mount).free - free)))
        try:
            yield Limits()
        finally:
            filler.unlink()
