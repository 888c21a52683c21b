"""Other people's classes by name: `package.module:Class`, `file.py:Class`, or an installed entry point."""

from __future__ import annotations

import hashlib
import inspect
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import entry_points
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any

from caldrive.provenance import file_digest


@dataclass(frozen=True)
class Plugin:
    """Something that makes an object. name: for tables; source: a digest of the file that it is written in."""

    name: str
    make: Callable[..., Any]
    source: str

    def build(self, **offered: Any) -> Any:
        """The object, made with those of the offered values that its maker takes. Raises ValueError where making it
        fails."""
        try:
            taken = inspect.signature(self.make).parameters
            return self.make(**{name: value for name, value in offered.items() if name in taken})
        except (Exception, SystemExit) as error:  # it is somebody else's code
            raise ValueError(f"found that {self.name} cannot be made ({described(error)}): correct its code") from error

    def takes(self, name: str) -> bool:
        """Whether its maker has a parameter of this name."""
        return name in inspect.signature(self.make).parameters


def described(error: BaseException) -> str:
    """An error of somebody else's code in a few words, with the line that it comes from."""
    trace, where = error.__traceback__, ""
    while trace is not None:
        where = f", {Path(trace.tb_frame.f_code.co_filename).name} line {trace.tb_lineno}"
        trace = trace.tb_next
    return f"{type(error).__name__}: {error}{where}"


def is_plugin(text: str) -> bool:
    """Whether a text names a class rather than something registered."""
    return ":" in text


def full_name(text: str) -> str:
    """The same name for every folder and process: the path of a .py or .toml file made absolute."""
    place, _, attribute = text.rpartition(":")
    if place.endswith(".py"):
        return f"{Path(place).resolve()}:{attribute}"
    return str(Path(text).resolve()) if text.endswith(".toml") else text


def short_name(text: str) -> str:
    """The name for tables: a class without its place, a file without its folder."""
    return text.rpartition(":")[2] if is_plugin(text) else Path(text).name


def load_plugin(text: str, option: str) -> Plugin:
    """What a text names. option: where it was given, for errors. Raises ValueError where there is no such thing."""
    place, _, attribute = text.rpartition(":")
    module = _from_file(Path(place), option) if place.endswith(".py") else _from_module(place, option)
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
    path = path.resolve()
    if not path.is_file():
        raise ValueError(f"found no file {path}, wanted Python code: type {option} FILE.py:CLASS")
    # A file that has changed since is another module: what is driven is what its digest says.
    content = str(path).encode() + path.read_bytes()
    name = f"caldrive_plugin_{hashlib.sha256(content).hexdigest()[:8]}_{path.stem}"
    if name in sys.modules:
        return sys.modules[name]
    spec = spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    sys.modules[name] = module  # dataclasses look their module up
    sys.path.insert(0, str(path.parent))
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:  # it is somebody else's code
        del sys.modules[name]
        raise ValueError(f"found that {path} cannot be loaded ({described(error)}): correct its code") from error
    finally:
        sys.path.remove(str(path.parent))
    return module


def _from_module(name: str, option: str) -> ModuleType:
    try:
        return import_module(name)
    except (Exception, SystemExit) as error:  # it is somebody else's code
        raise ValueError(
            f"found no module {name!r} that can be loaded ({described(error)}), wanted one: "
            f"type {option} PACKAGE.MODULE:CLASS or FILE.py:CLASS"
        ) from error


def _digest(module: ModuleType) -> str:
    path = getattr(module, "__file__", None)  # none for a module that is built in
    return file_digest(Path(path)) if path else module.__name__
