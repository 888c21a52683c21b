"""Where results go: looked at before the work begins, so that an hour's drive does not end at a locked door."""

from __future__ import annotations

import os
from pathlib import Path


def require_writable_folder(folder: Path, option: str = "--out") -> None:
    """Raises OSError where the folder neither is there to be written to nor can be made. option: what named it."""
    nearest = next(one for one in (folder.absolute(), *folder.absolute().parents) if one.exists())
    if not nearest.is_dir():
        raise OSError(f"found that {nearest} is a file, wanted a folder to write to: give another {option}")
    if not os.access(nearest, os.W_OK | os.X_OK):
        raise OSError(
            f"found that {nearest} cannot be written to, wanted a folder for the results: give another {option}"
        )


def require_writable_file(path: Path, option: str) -> None:
    """Raises OSError where a file cannot be written under that name. option: what named it."""
    if path.is_dir():
        raise OSError(f"found that {path} is a folder, wanted the name of a file: type {option} {path / 'NAME'}")
    require_writable_folder(path.parent, option)
