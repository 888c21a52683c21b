"""Where networks that were made from maps are kept between runs, so that a map is converted once.

A file's name tells what it was made of and what it contains. One that is broken, or that somebody else may have put
there, is as good as none: the network is made again. Without any folder to write to it is kept in memory.
"""

from __future__ import annotations

import hashlib
import os
import stat
import tempfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

from caldrive.files import write_whole
from caldrive.world.roads.memory_files import lasting_file

_OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH


def digest(*parts: bytes) -> str:
    """Tells contents, and where one ends and the next begins, from any others."""
    return hashlib.sha256(b"".join(hashlib.sha256(part).digest() for part in parts)).hexdigest()[:32]


def kept_network(key: str, make: Callable[[], bytes]) -> Path:
    """A file with the network that `make` makes, or has made before. key: of all that it depends on."""
    for folder in _folders():
        for path in folder.glob(f"{key}-*.net.xml"):
            if _is_whole(path):
                return path
    network = make()
    name = f"{key}-{digest(network)}.net.xml"
    for folder in _folders():
        with suppress(OSError):  # full, read-only, a file in the way: the next one may do
            write_whole(folder / name, network)
            return folder / name
    return lasting_file(network)


def _folders() -> Iterator[Path]:
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


def _is_whole(path: Path) -> bool:
    """Whether a file contains what its name says."""
    try:
        return path.name.endswith(f"-{digest(path.read_bytes())}.net.xml")
    except OSError:
        return False
