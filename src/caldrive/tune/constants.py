"""The controller's constants one by one: their names, what they may be on a slider, and a file with those that differ.

A name is that of the file that `--controller` reads, such as `longitudinal.cruise.kp`; the two numbers of a steering
law are `lateral.left.gain` and `lateral.left.damping`.
"""

from __future__ import annotations

import ast
import inspect
import math
import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, fields, is_dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, TypeVar

from caldrive.control.controller import ControlConfig
from caldrive.control.limits import LIMITS, USUAL
from caldrive.control.presets import DEFAULT, PRESETS
from caldrive.files import write_whole
from caldrive.formats import toml

PAIR = ("gain", "damping")  # what the two numbers of a steering law are
REACH = 3.0  # a slider's end, in units of the largest value that a preset has
DIGITS = 6  # after the point, of numbers in a file
Settings = TypeVar("Settings")


@dataclass(frozen=True)
class Constant:
    """A constant, and the slider for it."""

    name: str
    about: str
    """What it is, from its settings' docstring."""
    kind: Literal["number", "whole", "switch"]
    low: float
    """The slider's left end."""
    high: float
    """Its right end."""
    unlimited: float | Literal[False] | None = False
    """What the right end stands for, where that is no limit: None or infinity. False: it is a value as any other."""

    @property
    def step(self) -> float:
        """By how much the slider moves: between a hundredth and a thousandth of its length."""
        return 1.0 if self.kind == "whole" else 10.0 ** (math.floor(math.log10(self.high - self.low)) - 2)

    def value_at(self, position: float) -> Any:
        """The constant for a slider's position, or for a switch's."""
        if self.kind == "switch":
            return bool(position)
        if self.unlimited is not False and position >= self.high:
            return self.unlimited
        return round(position) if self.kind == "whole" else round(float(position), DIGITS)

    def position_of(self, value: Any) -> Any:
        """The position for a value of the constant."""
        return self.high if value is None or value == math.inf else value


def values_of(config: ControlConfig) -> dict[str, Any]:
    """All constants by name."""
    return {name: value for name, value, _ in _walk(config)}


def with_values(config: Settings, values: Mapping[str, Any], place: str = "") -> Settings:
    """The settings with some constants changed, by name."""
    changes: dict[str, Any] = {}
    for field in fields(config):  # type: ignore[arg-type]
        name, old = f"{place}{field.name}", getattr(config, field.name)
        if is_dataclass(old):
            changes[field.name] = with_values(old, values, f"{name}.")
        elif isinstance(old, tuple):
            changes[field.name] = tuple(values.get(f"{name}.{part}", x) for part, x in zip(PAIR, old, strict=True))
        else:
            changes[field.name] = values.get(name, old)
    return replace(config, **changes)  # type: ignore[type-var]


def constants(config: ControlConfig = DEFAULT) -> tuple[Constant, ...]:
    """All of them, with sliders that reach well beyond the presets' values and this controller's."""
    known = [values_of(one) for one in (*PRESETS.values(), config)]
    return tuple(_constant(name, about, [one[name] for one in known]) for name, _, about in _walk(config))


def _constant(name: str, about: str, values: list[Any]) -> Constant:
    if isinstance(values[0], bool):
        return Constant(name, about, "switch", 0.0, 1.0)
    words = [word for word in name.split(".") if word not in PAIR]
    low, high = LIMITS.get(words[-1], USUAL)
    finite = [value for value in values if value is not None and value < math.inf]
    if reach := REACH * max(map(abs, finite), default=0.0):
        low, high = max(low, -reach), min(high, reach)
    endless = [value for value in values if value is None or value == math.inf]
    kind: Literal["number", "whole"] = "whole" if isinstance(values[0], int) else "number"
    return Constant(name, about, kind, low, high, endless[0] if endless else False)


def _walk(settings: Any, place: str = "") -> Iterator[tuple[str, Any, str]]:
    """Name, value and description of every constant of nested settings."""
    kind: Any = type(settings)
    about = descriptions(kind)
    for field in fields(settings):
        name, value = f"{place}{field.name}", getattr(settings, field.name)
        if is_dataclass(value):
            yield from _walk(value, f"{name}.")
        elif isinstance(value, tuple):
            yield from ((f"{name}.{part}", x, about[field.name]) for part, x in zip(PAIR, value, strict=True))
        else:
            yield name, value, about[field.name]


@lru_cache
def descriptions(kind: type[Any]) -> Mapping[str, str]:
    """The docstrings under the fields of a dataclass, by field."""
    [body] = ast.parse(textwrap.dedent(inspect.getsource(kind))).body
    assert isinstance(body, ast.ClassDef)
    found = {}
    for statement, after in zip(body.body, body.body[1:], strict=False):
        if (
            isinstance(statement, ast.AnnAssign)
            and isinstance(after, ast.Expr)
            and isinstance(after.value, ast.Constant)
        ):
            found[ast.unparse(statement.target)] = " ".join(str(after.value.value).split())
    return found


def controller_toml(config: ControlConfig) -> str:
    """The file that `--controller` takes: what differs from the nearest preset."""
    changes = {name: _differences(asdict(config), asdict(preset)) for name, preset in PRESETS.items()}
    nearest = min(changes, key=lambda name: len(values_in(changes[name])))
    return toml({"preset": nearest} | changes[nearest])


def values_in(nested: Mapping[str, Any]) -> list[Any]:
    """The leaves of nested dictionaries."""
    return [leaf for value in nested.values() for leaf in (values_in(value) if isinstance(value, dict) else [value])]


def write_controller(path: Path, config: ControlConfig) -> None:
    """Writes the file, whole."""
    write_whole(path, controller_toml(config).encode())


def _differences(values: Mapping[str, Any], base: Mapping[str, Any]) -> dict[str, Any]:
    """Those of nested dictionaries that differ, without empty ones."""
    found: dict[str, Any] = {}
    for name, value in values.items():
        if isinstance(value, dict):
            if inside := _differences(value, base[name]):
                found[name] = inside
        elif value != base[name]:
            found[name] = value
    return found
