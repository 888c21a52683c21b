"""What every verb of the command line returns, and the options that they share."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

TYPED = {"typed": True}  # an option that no file can give


@dataclass(frozen=True)
class Answer:
    """What a command found: values for --json, something to show to people, and the exit code."""

    values: dict[str, Any]
    shown: Any
    code: int = 0


@dataclass(frozen=True, kw_only=True)
class Output:
    """How a verb answers."""

    json: bool = field(default=False, metadata=TYPED)
    """Print the result as JSON, and nothing else."""


@dataclass(frozen=True, kw_only=True)
class Configurable(Output):
    """A verb whose options may come from a file."""

    config: Path | None = field(default=None, metadata=TYPED)
    """A TOML file with any of these options; what the command line says goes before it."""
