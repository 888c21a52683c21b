"""Other people's classes by name: `package.module:Class`, `file.py:Class`, or an installed entry point."""

from __future__ import annotations

import hashlib
import inspect
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import entry_points
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any

from caldrive.provenance import file_digest

MOST_BYTES = 10**7  # of a file with code


@dataclass(frozen=True)
class Plugin:
    """Something that makes an object. name: for tables; source: a digest of the file that it is written in."""

    name: str
    make: Callable[..., Any]
    source: str

    def build(self, **offered: Any) -> Any:
        """The object, made with those of the offered values that its maker takes. Raises ValueError where making it
        fails."""
        with somebody_elses_code(f"found that {self.name} cannot be made ({{}}): correct its code"):
            taken = inspect.signature(self.make).parameters
            return self.make(**{name: value for name, value in offered.items() if name in taken})

    def takes(self, name: str) -> bool:
        """Whether its maker has a parameter of this name."""
        return name in inspect.signature(self.make).parameters


def described(error: BaseException) -> str:
    """An error of somebody else's code in a few words, with the line that it comes from."""
    kind, where = type(error).__name__, _place(error)
    try:
        return f"{kind}: {error.msg if isinstance(error, SyntaxError) else error}{where}"
    except Exception:  # its text is somebody else's code, too
        return f"{kind}{where}"


def _place(error: BaseException) -> str:
    """The file and line that an error comes from, if one is known."""
    if isinstance(error, SyntaxError) and error.filename:
        return f", {Path(error.filename).name} line {error.lineno}"
    trace, where = error.__traceback__, ""
    while trace is not None:
        file = trace.tb_frame.f_code.co_filename
        if not file.startswith("<frozen"):  # Python's own machinery of import
            where = f", {Path(file).name} line {trace.tb_lineno}"
        trace = trace.tb_next
    return where


@contextmanager
def somebody_elses_code(sentence: str) -> Iterator[None]:
    """Says what goes wrong in code that is not ours. sentence: of the error, with {} for what it was. Raises
    ValueError."""
    try:
        yield
    except (KeyboardInterrupt, GeneratorExit):  # it was not the code
        raise
    except BaseException as error:
        raise ValueError(sentence.replace("{}", described(error))) from error


def attribute(thing: object, name: str, otherwise: Any = None) -> Any:
    """An attribute of somebody's object, which may be computed by somebody's code. Raises ValueError where that
    fails."""
    with somebody_elses_code(f"found that {type(thing).__name__} fails when asked for {name} ({{}}): correct its code"):
        return getattr(thing, name, otherwise)


def is_plugin(text: str) -> bool:
    """Whether a text names a class rather than something registered."""
    return ":" in text


def full_name(text: str) -> str:
    """The same name for every folder and process: the path of a .py or .toml file made absolute."""
    place, _, attribute = text.rpartition(":")
    if place.endswith(".py"):
        return f"{os.path.realpath(place)}:{attribute}"
    return os.path.realpath(text) if text.endswith(".toml") else text


def short_name(text: str) -> str:
    """The name for tables: a class without its place, a file without its folder."""
    return text.rpartition(":")[2] if is_plugin(text) else Path(text).name


def load_plugin(text: str, option: str) -> Plugin:
    """What a text names. option: where it was given, for errors. Raises ValueError where there is no such thing."""
    place, _, attribute = text.rpartition(":")
    module = _from_file(Path(place), option) if place.endswith(".py") else _from_module(place, option)
    with somebody_elses_code(f"found that {place} gives no {attribute!r} ({{}}): correct its code"):
        make = getattr(module, attribute, None)
    if not callable(make):
        known = [name for name, value in vars(module).items() if inspect.isclass(value) and not name.startswith("_")]
        raise ValueError(
            f"found no class {attribute!r} in {place}, wanted one of {', '.join(known) or 'none, as it has no class'}: "
            f"type {option} {place}:CLASS"
        )
    return Plugin(attribute, make, _digest(module))


def find_plugin(name: str, kind: str, known: Sequence[str]) -> Plugin:
    """What somebody calls by `package.module:Class`, `file.py:Class` or the name that an installed package offers.

    kind: agent, controller or world, for the option and the group of entry points; known: what caldrive has itself, for
    the error. Raises ValueError where there is no such thing.
    """
    option, group = f"--{kind}", f"caldrive.{kind}s"
    if is_plugin(name):
        return load_plugin(name, option)
    for entry in entry_points(group=group, name=name):
        return load_plugin(entry.value, option)
    names = ", ".join([*known, *sorted(entry.name for entry in entry_points(group=group))])
    raise ValueError(
        f"found {kind} {name!r}, wanted one of {names}, or your own class: "
        f"type {option} {known[0]}, or {option} FILE.py:CLASS"
    )


def _from_file(path: Path, option: str) -> ModuleType:
    path, code = _read_code(path, option)
    # A file that has changed since is another module: what is driven is what its digest says.
    name = f"caldrive_plugin_{hashlib.sha256(str(path).encode() + code).hexdigest()[:8]}_{path.stem}"
    if name in sys.modules:
        return sys.modules[name]
    spec = spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    sys.modules[name] = module  # dataclasses look their module up
    sys.path.insert(0, str(path.parent))
    try:
        with somebody_elses_code(f"found that {path} cannot be loaded ({{}}): correct its code"):
            spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    finally:
        sys.path.remove(str(path.parent))
    return module


def _read_code(path: Path, option: str) -> tuple[Path, bytes]:
    """The absolute path of a file with code, and its content. Raises ValueError where there is no such file."""
    try:
        path = path.resolve()
        is_file = path.is_file()
    except (OSError, RuntimeError, ValueError):  # links in a circle, a name too long, a null byte
        is_file = False
    if not is_file:
        raise ValueError(f"found no file {str(path)!r}, wanted Python code: type {option} FILE.py:CLASS")
    if path.stat().st_size > MOST_BYTES:
        raise ValueError(
            f"found {path.stat().st_size / 1e6:.0f} MB in {path}, wanted Python code of {MOST_BYTES / 1e6:.0f} MB at "
            f"most: type {option} FILE.py:CLASS"
        )
    return path, path.read_bytes()


def _from_module(name: str, option: str) -> ModuleType:
    how = f"wanted one: type {option} PACKAGE.MODULE:CLASS or FILE.py:CLASS"
    with somebody_elses_code(f"found no module {name!r} that can be loaded ({{}}), {how}"):
        return import_module(name)


def _digest(module: ModuleType) -> str:
    path = getattr(module, "__file__", None)  # none for a module that is built in
    return file_digest(Path(path)) if path else module.__name__
