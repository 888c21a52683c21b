"""What every verb of the command line returns, and the options that they share."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Answer:
    """What a command found: values for --json, something to show to people, and the exit code."""

    values: dict[str, Any]
    shown: Any
    code: int = 0


@dataclass(frozen=True, kw_only=True)
class Output:
    """How a verb answers."""

    json: bool = False
    """Print the result as JSON, and nothing else."""


@dataclass(frozen=True, kw_only=True)
class Configurable(Output):
    """A verb whose options may come from a file."""

    config: Path | None = None
    """A TOML file with any of these options; what the command line says goes before it."""
