"""Files: written whole or not at all, read with their types checked, in folders that one process owns."""

from __future__ import annotations

import fcntl
import io
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import is_dataclass
from glob import escape
from itertools import chain
from pathlib import Path
from typing import Any, TypeVar

import msgspec


def write_whole(path: Path, content: bytes) -> None:
    """Write a file so that it appears whole or not at all. Raises OSError, which names the file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = temporary_path(path)
    try:
        with temporary.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())  # else a power cut could leave the name and not the content
        os.replace(temporary, path)
    except OSError as error:  # from a full disk it comes without the name
        raise OSError(error.errno, error.strerror, str(path)) from error
    finally:
        temporary.unlink(missing_ok=True)


def temporary_path(path: Path) -> Path:
    """Where a file is written before it takes its name. What processes that were killed left there is removed."""
    for old in path.parent.glob(f".{escape(path.name)}.*.tmp"):
        if not _lives(old.name.split(".")[-2]):
            old.unlink(missing_ok=True)
    return path.with_name(f".{path.name}.{os.getpid()}.tmp")


def _lives(number: str) -> bool:
    """Whether there is a process of this number; True for what is no number, as that is somebody else's."""
    try:
        os.kill(int(number), 0)
    except ProcessLookupError:
        return False
    except (ValueError, OverflowError, PermissionError):
        pass
    return True


def write_figure(path: Path, figure: Any, dpi: int = 90) -> None:
    """Write a matplotlib figure as PNG, whole."""
    content = io.BytesIO()
    figure.savefig(content, format="png", dpi=dpi)
    write_whole(path, content.getvalue())


def json_line(values: dict[str, Any]) -> bytes:
    """Values in JSON's types as one line."""
    return json.dumps(values, separators=(",", ":"), allow_nan=False).encode() + b"\n"


T = TypeVar("T")


def read_json(text: bytes | str, kind: type[T]) -> T:
    """What a JSON text says, as a plain type, a TypedDict or a dataclass.

    Raises ValueError with the place where it says something else. NaN and Infinity are no JSON, and a null byte is part
    of no name.
    """
    content = text.encode() if isinstance(text, str) else text
    if b"\\u0000" in content:
        raise ValueError("it has a null byte")
    try:
        return msgspec.json.decode(content, type=kind)
    except RecursionError as error:
        raise ValueError("it is nested too deep") from error


def as_type(values: Any, kind: type[T]) -> T:
    """What JSON's values say, as in `read_json`. A dataclass, and those within it, are refused values that are none of
    their fields."""
    value = msgspec.convert(values, kind)
    if is_dataclass(value) and (unknown := _unknown(values, msgspec.to_builtins(value))):
        raise ValueError(f"{unknown[0]} is none of the fields of {kind.__name__}")
    return value


def _unknown(values: Any, known: Any) -> list[str]:
    """Names in nested dictionaries that `known` does not have."""
    if not isinstance(values, dict) or not isinstance(known, dict):
        return []
    nested = (_unknown(value, known[name]) for name, value in values.items() if name in known)
    return [*(name for name in values if name not in known), *chain.from_iterable(nested)]


@contextmanager
def locked_folder(folder: Path) -> Iterator[None]:
    """Keeps a folder, made if need be, for this process; two that write at once would lose results.

    The lock ends with the block, or with the process; folders that were made for a block that failed, and are empty,
    go again. Raises ValueError where another process has it.
    """
    made = [path for path in (folder, *folder.parents) if not path.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    file = os.open(folder, os.O_RDONLY)
    try:
        _lock(file, folder)
        yield
    except BaseException:
        with suppress(OSError):  # something is in it
            for path in made:
                path.rmdir()
        raise
    finally:
        os.close(file)


def _lock(file: int, folder: Path) -> None:
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise ValueError(
            f"found another process at work in {folder}, wanted the folder alone: wait for it, or give another --out"
        ) from error


def claim_folder(path: Path, wanted: Mapping[str, Any], kind: str) -> None:
    """Writes what long work depends on into a file of its folder. kind: of the work, in words. Raises ValueError where
    what is there depends on something else."""
    if not path.is_file():
        write_whole(path, json.dumps(wanted, indent=1).encode())
        return
    try:
        found = read_json(path.read_bytes(), dict[str, Any])
    except ValueError as error:
        raise ValueError(f"found that {path} is damaged ({error}), wanted {kind}'s: give another --out") from error
    for name, value in wanted.items():
        if found.get(name) != value:
            raise ValueError(
                f"found in {path.parent} {kind} with {name} {found.get(name)}, wanted {value}: type the same "
                "settings as before, or another --out"
            )
