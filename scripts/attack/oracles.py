"""Which changed files are bad for certain. This asks other libraries than the program does, or the paper, so that a
fault of the program's own checks shows."""

from __future__ import annotations

import io
import json
import math
import tomllib
from collections.abc import Callable, Iterator
from typing import Any
from xml.etree import ElementTree as ET

import pyarrow as pa
import pyarrow.parquet as pq
from PIL import Image
from safetensors import SafetensorError
from safetensors.numpy import load

NOT_NEGATIVE = ("n_vehicles", "n_pedestrians", "seed", "crossing", "time_limit")
MAY_BE_NEGATIVE = "controller.toml"  # its gains; in the other settings nothing is


def why_bad(name: str, content: bytes) -> str:
    """What is wrong with a file, empty where nothing is known."""
    look = LOOKS.get(name.rpartition(".")[2])
    if look is None:
        return ""
    try:
        wrong = look(name, content)
    except (ValueError, TypeError, KeyError, AttributeError, OSError, RecursionError, ET.ParseError, pa.ArrowException,
            SafetensorError, SyntaxError, MemoryError, Image.DecompressionBombError) as error:  # fmt: skip
        wrong = f"{type(error).__name__}: {str(error)[:100]}"
    return f"{name}: {wrong}" if wrong else ""


def _json(name: str, content: bytes) -> str:
    values = json.loads(content, parse_constant=_no_number)
    if not name.endswith(("suite.json", "own_map.json")):
        return ""
    if not isinstance(values, list) or not values:
        return "no list of trials"
    return next((wrong for row in values if (wrong := _trial(row))), "")


def _no_number(text: str) -> float:
    raise ValueError(f"{text} is no JSON")


def _trial(row: dict[str, Any]) -> str:
    scenario = row["scenario"]
    if not isinstance(row["key"], str) or not isinstance(row["condition"], str):
        return "a trial without names"
    for name in NOT_NEGATIVE:
        value = scenario.get(name)
        if value is not None and value < 0:
            return f"{name} is {value}"
    if scenario["weather"] not in range(1, 15) or isinstance(scenario["weather"], bool):
        return f"weather is {scenario['weather']}"
    places = [scenario[pose][axis] for pose in ("start", "goal") for axis in ("x", "y", "heading")]
    return "" if all(abs(place) < 1e6 for place in places) else "a place out of the world"


def _toml(name: str, content: bytes) -> str:
    for key, value in _leaves(tomllib.loads(content.decode()), ""):
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if number and (math.isnan(value) or (value < 0 and name != MAY_BE_NEGATIVE)):
            return f"{key} is {value}"
    return ""


def _leaves(values: Any, key: str) -> Iterator[tuple[str, Any]]:
    if isinstance(values, dict | list):
        for name, value in values.items() if isinstance(values, dict) else enumerate(values):
            yield from _leaves(value, str(name))
    else:
        yield key, values


def _xml(name: str, content: bytes) -> str:
    root = ET.fromstring(content)
    lengths = [road.get("length", "") for road in root.iter("road")]
    if root.tag != "OpenDRIVE" or not lengths:
        return "no road"
    return next((f"a road of length {text!r}" for text in lengths if not 0 < float(text) < 1e6), "")


def _safetensors(name: str, content: bytes) -> str:
    return "" if load(content) else "no tensors"


def _parquet(name: str, content: bytes) -> str:
    table = pq.read_table(io.BytesIO(content), page_checksum_verification=True)
    for column in table.column_names:
        if pa.types.is_floating(table[column].type):
            values = [value for value in table[column].to_pylist() if value is not None]
            if len(values) < len(table) or not all(map(math.isfinite, values)):
                return f"{column} is no number"
        if column in ("frame", "camera", "time", "speed") and min(table[column].to_pylist(), default=0) < 0:
            return f"{column} is less than 0"
    return "" if len(table) else "no rows"


def _picture(name: str, content: bytes) -> str:
    with Image.open(io.BytesIO(content)) as picture:
        picture.load()
    return ""


LOOKS: dict[str, Callable[[str, bytes], str]] = {
    "json": _json, "toml": _toml, "xodr": _xml, "safetensors": _safetensors, "parquet": _parquet, "png": _picture,
}  # fmt: skip
