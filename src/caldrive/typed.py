"""Values from outside, as JSON, checked against the types that they should have."""

from __future__ import annotations

from dataclasses import is_dataclass
from typing import Any, TypeVar

import msgspec

T = TypeVar("T")


def read_json(text: bytes | str, kind: type[T]) -> T:
    """What a JSON text says, as a plain type, a TypedDict or a dataclass.

    Raises ValueError with the place where it says something else. NaN and Infinity are no JSON.
    """
    try:
        return msgspec.json.decode(text, type=kind)
    except RecursionError as error:
        raise ValueError("it is nested too deep") from error


def as_type(values: Any, kind: type[T]) -> T:
    """What JSON's values say, as in `read_json`. A dataclass, and those within it, are refused values that are none of
    their fields."""
    found = msgspec.convert(values, kind)
    if is_dataclass(found) and (unknown := _unknown(values, msgspec.to_builtins(found))):
        raise ValueError(f"{unknown[0]} is none of the fields of {kind.__name__}")
    return found


def _unknown(values: Any, known: Any) -> list[str]:
    """Names in nested dictionaries that others do not have."""
    if not isinstance(values, dict) or not isinstance(known, dict):
        return []
    within = (_unknown(value, known[name]) for name, value in values.items() if name in known)
    return [name for name in values if name not in known] + [one for part in within for one in part]
