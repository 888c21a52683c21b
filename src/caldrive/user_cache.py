"""Folders where what takes long to make is kept between runs, for one user alone."""

from __future__ import annotations

import os
import stat
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

_OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH


def own_folders() -> Iterator[Path]:
    """Folders of the user alone, made where they are missing; the best one first."""
    home = Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"))
    with suppress(OSError):
        if home.is_absolute():  # it is not where nobody knows the user's home
            yield _own_folder(home / "caldrive")
    with suppress(OSError):
        yield _own_folder(Path(tempfile.gettempdir()) / f"caldrive-{os.getuid()}")


def _own_folder(folder: Path) -> Path:
    """The folder, made if need be. Raises OSError where it is no folder, or where others could put files into it."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    with suppress(FileExistsError):
        folder.mkdir(mode=0o700)
    about = folder.stat()
    is_own = folder.lstat().st_uid == about.st_uid == os.getuid()  # somebody else's link could lead to a folder of ours
    if not stat.S_ISDIR(about.st_mode) or not is_own or about.st_mode & _OTHERS_WRITE:
        raise PermissionError(f"{folder} is not this user's alone")
    return folder
