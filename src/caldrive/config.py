"""Settings from a TOML file, laid over a dataclass with defaults: what a file does not name stays as it is."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

import msgspec

T = TypeVar("T")


def from_toml(path: Path, presets: Mapping[str, T], default: T) -> T:
    """The settings in a TOML file; a table stands for a nested dataclass, and `preset` says over which of the presets
    they are laid.

    Raises ValueError with the file, the key and what could stand there.
    """
    try:
        values = tomllib.loads(path.read_text())
    except OSError as error:
        raise ValueError(f"found no file {path} that can be read, wanted settings in TOML: give another") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"found that {path} is no TOML ({error}), wanted lines like cap = 20.0: correct it") from error
    name = values.pop("preset", None)
    if name is not None and name not in presets:
        raise ValueError(f"found preset {name!r} in {path}, wanted one of {', '.join(presets)}: correct the name")
    return overlaid(default if name is None else presets[name], values, str(path))


def overlaid(defaults: T, values: dict[str, Any], where: str) -> T:
    """A dataclass with some of its fields replaced. where: what the values come from, for errors.

    Raises ValueError for a field that it does not have, or a value of another type.
    """
    known = [field.name for field in fields(defaults)]  # type: ignore[arg-type]
    hints = get_type_hints(type(defaults))
    changes = {}
    for name, value in values.items():
        if name not in known:
            raise ValueError(f"found {name} in {where}, wanted one of {', '.join(known)}: correct the name")
        old = getattr(defaults, name)
        if is_dataclass(old) and isinstance(value, dict):
            changes[name] = overlaid(old, value, f"{where}, {name}")
        else:
            changes[name] = _converted(value, hints[name], f"{where}, {name}")
    try:
        return replace(defaults, **changes)  # type: ignore[type-var]
    except ValueError as error:
        raise ValueError(f"found in {where} what cannot be: {error}") from error


def _converted(value: Any, kind: Any, where: str) -> Any:
    try:
        return msgspec.convert(value, kind, strict=True)
    except msgspec.ValidationError as error:
        raise ValueError(f"found {value!r} in {where} ({error}): give another value") from error
