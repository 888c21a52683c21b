"""What every verb of the command line returns, and the option that they all have."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Answer:
    """What a command found: values for --json, something to show to people, and the exit code."""

    values: dict[str, Any]
    shown: Any
    code: int = 0


@dataclass(frozen=True)
class Output:
    json: bool = False
    """Print the result as JSON, and nothing else."""
