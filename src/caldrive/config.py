"""Settings from a TOML file, laid over a dataclass with defaults: what a file does not name stays as it is."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping
from dataclasses import Field, fields, is_dataclass, replace
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

import msgspec

T = TypeVar("T")
MOST_BYTES = 10**7  # of a file of settings


def from_toml(path: Path, presets: Mapping[str, T], default: T) -> T:
    """The settings in a TOML file; a table stands for a nested dataclass, and `preset` says over which of the presets
    they are laid.

    Raises ValueError with the file, the key and what could stand there.
    """
    try:
        values = tomllib.loads(_text(path))
    except OSError as error:
        raise ValueError(f"found no file {path} that can be read, wanted settings in TOML: give another") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise ValueError(f"found that {path} is no TOML ({error}), wanted lines like cap = 20.0: correct it") from error
    name = values.pop("preset", None)
    if name is not None and name not in presets:
        raise ValueError(f"found preset {name!r} in {path}, wanted one of {', '.join(presets)}: correct the name")
    return overlaid(default if name is None else presets[name], values, str(path))


def _text(path: Path) -> str:
    """A file's text. Raises OSError where there is none, such as for a device without end, ValueError for a large
    one."""
    if not path.is_file():
        raise FileNotFoundError(path)
    if (size := path.stat().st_size) > MOST_BYTES:
        raise ValueError(
            f"found {size / 1e6:.0f} MB in {path}, wanted settings in TOML of {MOST_BYTES / 1e6:.0f} MB at most: "
            "give another"
        )
    return path.read_text()


def overlaid(defaults: T, values: Mapping[str, Any], where: str) -> T:
    """A dataclass with some of its fields replaced. where: what the values come from, for errors.

    The fields of a nested dataclass whose metadata say `flat` are named without it; those whose metadata say `typed`
    stand on the command line only. Raises ValueError for a field that it does not have, or a value of another type.
    """
    hints, changes = get_type_hints(type(defaults)), dict[str, Any]()
    rest = dict(values)
    for field in _fields(defaults):
        old = getattr(defaults, field.name)
        if field.metadata.get("flat"):
            inside = {name: rest.pop(name) for name in _names(old) if name in rest}
            changes[field.name] = overlaid(old, inside, where)
        elif field.name in rest:
            place, value = f"{where}, {field.name}", rest.pop(field.name)
            nested = is_dataclass(old) and isinstance(value, dict)
            changes[field.name] = overlaid(old, value, place) if nested else _converted(value, hints[field.name], place)
    if rest:
        known = ", ".join(_names(defaults, flat=True))
        raise ValueError(f"found {next(iter(rest))} in {where}, wanted one of {known}: correct the name")
    try:
        return replace(defaults, **changes)  # type: ignore[type-var]
    except ValueError as error:
        raise ValueError(f"found in {where} what cannot be ({error}): change it") from error


def _fields(settings: Any) -> list[Field[Any]]:
    """The fields of a dataclass that a file may name."""
    return [field for field in fields(settings) if not field.metadata.get("typed")]


def _names(settings: Any, flat: bool = False) -> list[str]:
    """The names of a dataclass's fields; flat: with those of nested ones in the place of these."""
    names = []
    for field in _fields(settings):
        inside = flat and field.metadata.get("flat")
        names += _names(getattr(settings, field.name)) if inside else [field.name]
    return names


def _converted(value: Any, kind: Any, where: str) -> Any:
    def decode(wanted: type, value: Any) -> Any:
        return Path(value) if wanted is Path and isinstance(value, str) else value

    try:
        if "\\u0000" in json.dumps(value, default=str):  # no path, and no name of anything else
            raise msgspec.ValidationError("it has a null byte")
        return msgspec.convert(value, kind, strict=True, dec_hook=decode)
    except msgspec.ValidationError as error:
        raise ValueError(f"found {value!r} in {where} ({error}), wanted another value: change it") from error
