"""What an option may be, checked before the work begins, so that an hour's drive does not end at a locked door."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

Limits = Mapping[str, tuple[float, float]]  # from and to, both included, by the name of a setting

MOST_SEED = 2**31 - 1  # a million times as much is still a seed for torch
MOST_WORKERS = 1024
MOST_PIXELS = 4096  # a side of an image
MOST_LOOKS = 100  # of a town on one sheet
MOST_AREA = 100_000_000  # pixels of a picture that somebody gives


def require_within(option: str, value: float, low: float, high: float, usual: float) -> None:
    """Raises ValueError where the value of an option is not a number from low to high; usual: what to type instead."""
    if not low <= value <= high:
        wanted = f"{low} or more" if high == math.inf else f"{low} to {high}"
        raise ValueError(f"found {option} {value}, wanted {wanted}: type {option} {usual}")


def require_limits(values: Mapping[str, Any], limits: Limits, usual: Mapping[str, Any], group: str = "") -> None:
    """Raises ValueError where one of the settings is not within its limits. usual: what to type instead; group: of the
    options, such as augmentation in --augmentation.blur."""
    for name, (low, high) in limits.items():
        require_within(f"--{group and group + '.'}{name.replace('_', '-')}", values[name], low, high, usual[name])


def require_modules(extra: str, *modules: str) -> None:
    """Raises RuntimeError where a module is missing that comes with an extra of this package."""
    for name in modules:
        if find_spec(name) is None:
            raise RuntimeError(f"found no {name}, wanted it: type pip install 'caldrive[{extra}]'")


class TooLargeError(ValueError):
    """A picture has more pixels than are read; the message says how many."""


def require_picture_size(name: str, width: int, height: int) -> None:
    """Raises TooLargeError where a picture, by what its first bytes say, would take more memory than anybody's does.
    name: what to call it."""
    if width * height > MOST_AREA:
        raise TooLargeError(
            f"found {name} of {width} x {height} pixels, wanted {MOST_AREA // 10**6} million at most: make it smaller"
        )


def require_writable_folder(folder: Path, option: str = "--out") -> None:
    """Raises OSError where the folder neither is there to be written to nor can be made. option: what named it."""
    nearest = next(path for path in (folder.absolute(), *folder.absolute().parents) if path.exists())
    if not nearest.is_dir():
        raise OSError(f"found that {nearest} is a file, wanted a folder to write to: give another {option}")
    if not os.access(nearest, os.W_OK | os.X_OK):
        raise OSError(
            f"found that {nearest} cannot be written to, wanted a folder for the results: give another {option}"
        )


def require_writable_file(path: Path, option: str, ending: str) -> None:
    """Raises ValueError where the name has another ending, by which a picture could take a recording's place, OSError
    where a file cannot be written under it. option: what named it."""
    if path.suffix.lower() != ending:
        better = path.with_suffix(ending) if path.name else path / f"NAME{ending}"
        raise ValueError(f"found {option} {path}, wanted a name that ends in {ending}: type {option} {better}")
    if path.is_dir():
        raise OSError(f"found that {path} is a folder, wanted the name of a file: type {option} {path / 'NAME'}")
    require_writable_folder(path.parent, option)
