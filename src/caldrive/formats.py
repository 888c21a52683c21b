"""What several commands write for people and for files: tables in Markdown, settings in TOML."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any


def markdown_table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table; whatever a cell holds, no line ends in it and no other cell begins."""
    first, *others = ("| " + " | ".join(map(_cell, row)) + " |" for row in (head, *rows))
    return "\n".join((first, "|" + "---|" * len(head), *others))


def _cell(text: str) -> str:
    return " ".join(text.splitlines()).replace("|", "\\|")


def toml(values: Mapping[str, Any]) -> str:
    """Nested dictionaries of numbers, switches, words and tuples of these; what stands in no table comes first."""
    return "\n".join(_lines(values)).lstrip() + "\n"


def _lines(values: Mapping[str, Any], table: str = "") -> Iterator[str]:
    plain = {name: value for name, value in values.items() if not isinstance(value, dict)}
    if plain and table:
        yield f"\n[{table}]"
    yield from (f"{name} = {_literal(value)}" for name, value in plain.items())
    for name, value in values.items():
        if isinstance(value, dict):
            yield from _lines(value, f"{table}.{name}" if table else name)


def _literal(value: Any) -> str:
    if isinstance(value, tuple):
        return f"[{', '.join(map(_literal, value))}]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    return str(value)
