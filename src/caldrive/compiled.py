"""Loops that numba compiles for the processor that they run on.

Nothing is reordered and no two operations are joined into one: the same numbers come out on every processor. The
machine code is kept in a folder of the user's, one for each state of the sources, so that only the first run on a
machine compiles. numba by itself would notice changes of a function's own file only, not of what is inlined. It
unpickles what lies there, so the folder is the user's alone.
"""

from __future__ import annotations

import hashlib
import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from typing import Any, ClassVar, TypeVar, cast

import numba
import numpy as np
from numba.core import caching, config, event
from numpy.typing import NDArray

from caldrive.user_cache import own_folders

Function = TypeVar("Function", bound=Callable[..., Any])
Floats = NDArray[np.float32]
Integers = NDArray[np.int32]
WITHOUT_COUNTS: dict[str, Any] = {"error_model": "numpy", "_nrt": False}
KEPT = 4  # states of the sources whose code is kept
f32, i32 = np.float32, np.int32  # types of numbers in compiled code: mixed ones would be widened


def compiled(function: Function) -> Function:
    """The function, compiled when it is first called. Indices out of range are not noticed. It makes no arrays, as it
    does not count who holds one: that would take most of its time."""
    made: Any = numba.njit(**WITHOUT_COUNTS)(function)
    if (folder := code_folder()) is not None:
        with _kept_in(folder):
            made._cache = _Code(function)  # type: ignore[no-untyped-call]
    return cast("Function", made)


def inlined(function: Function) -> Function:
    """Likewise, but made a part of each compiled function that calls it: for what is called for every pixel."""
    made: Function = numba.njit(forceinline=True, **WITHOUT_COUNTS)(function)
    return made


@lru_cache(maxsize=1)
def code_folder() -> Path | None:
    """Where the machine code of these sources is kept, None where nothing can be."""
    for folder in own_folders():
        with suppress(OSError):
            made = folder / f"compiled-{_state_of_sources()}"
            made.mkdir(mode=0o700, exist_ok=True)
            made.touch()
            with suppress(OSError):  # another process may remove them, too
                for old in sorted(folder.glob("compiled-*"), key=lambda path: path.stat().st_mtime)[:-KEPT]:
                    shutil.rmtree(old, ignore_errors=True)
            return made
    return None


def _state_of_sources() -> str:
    """Tells the sources that anything compiled may be made of from any others."""
    root = Path(__file__).parent
    packages = ("world", "perception/inference")
    sources = [path for package in packages for path in sorted((root / package).rglob("*.py"))]
    sources += [root / "compiled.py", root / "datatypes.py"]
    return hashlib.sha256(b"".join(hashlib.sha256(path.read_bytes()).digest() for path in sources)).hexdigest()[:16]


class _Place(caching.UserProvidedCacheLocator):
    """Where the code of a function lies: by its place in the package, wherever that is installed."""

    @classmethod
    def get_suitable_cache_subpath(cls, py_file: str) -> str:
        return Path(py_file).parent.name


class _Kept(caching.CompileResultCacheImpl):
    _locator_classes: ClassVar[list[type[object]]] = [_Place]  # type: ignore[misc]


class _Code(caching.FunctionCache):
    """The kept code of a function."""

    _impl_class = _Kept

    def save_overload(self, sig: Any, data: Any) -> None:
        with suppress(OSError):  # a full disk: the next run compiles again
            super().save_overload(sig, data)  # type: ignore[no-untyped-call]


@contextmanager
def _kept_in(folder: Path) -> Iterator[None]:
    """What is decorated meanwhile is kept in the folder; numba asks for it then."""
    before = vars(config)["CACHE_DIR"]
    vars(config)["CACHE_DIR"] = str(folder)
    try:
        yield
    finally:
        vars(config)["CACHE_DIR"] = before


class _Announcement(event.Listener):
    """Tells the user once why nothing happens for a while."""

    made = False

    def on_start(self, event: Any) -> None:
        if not self.made:
            _Announcement.made = True
            with suppress(OSError, ValueError):  # nobody may listen any more
                print("compiling for this processor, once: this takes up to a minute", file=sys.stderr)

    def on_end(self, event: Any) -> None:
        """Nothing to tell."""


event.register("numba:compile", _Announcement())  # type: ignore[no-untyped-call]
