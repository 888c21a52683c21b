"""The command line: each verb parses its options and calls one function.

Exit codes: 0 for success, 1 where a check that was asked for says no, 2 for an error, 130 after Ctrl-C.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro

from caldrive.driving.settings import DriveSettings, Progress, silent

Answer = tuple[int, dict[str, Any]]  # exit code, what --json prints


@dataclass(frozen=True)
class Drive(DriveSettings):
    json: bool = False
    """Print the results as JSON."""
    strict: bool = False
    """End with exit code 1 unless every episode reached its goal."""

    def run(self, progress: Progress) -> Answer:
        from caldrive.driving import drive, tables, trace

        report = drive.drive(self, progress)
        failed = sum(result.outcome is not drive.Outcome.SUCCESS for result in report.results)
        return int(self.strict and failed > 0), {}
