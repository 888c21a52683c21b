"""Where networks that were made from maps are kept between runs, so that a map is converted once.

A file's name tells what it was made of and what it contains. One that is broken, or that somebody else may have put
there, is as good as none: the network is made again. Without any folder to write to it is kept in memory.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from caldrive.files import write_whole
from caldrive.user_cache import own_folders
from caldrive.world.roads.memory_files import lasting_file


def digest(*parts: bytes) -> str:
    """Tells contents, and where one ends and the next begins, from any others."""
    return hashlib.sha256(b"".join(hashlib.sha256(part).digest() for part in parts)).hexdigest()[:32]


def kept_network(key: str, make: Callable[[], bytes]) -> Path:
    """A file with the network that `make` makes, or has made before. key: of all that it depends on."""
    for folder in own_folders():
        for path in folder.glob(f"{key}-*.net.xml"):
            if _is_whole(path):
                return path
    network = make()
    name = f"{key}-{digest(network)}.net.xml"
    for folder in own_folders():
        with suppress(OSError):  # full, read-only, a file in the way: the next one may do
            write_whole(folder / name, network)
            return folder / name
    return lasting_file(network)


def _is_whole(path: Path) -> bool:
    """Whether a file contains what its name says."""
    try:
        return path.name.endswith(f"-{digest(path.read_bytes())}.net.xml")
    except OSError:
        return False
