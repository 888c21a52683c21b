"""Which code made a result: a version that is raised when behaviour changes, and not when a file moves.

A recording, a benchmark's results and a replay are continued or compared only under one version. Moving a function,
renaming it or rewording a comment leaves it alone; anything that changes a number raises it. `tests/test_provenance.py`
drives, records and sees a few fixed situations and fails when their numbers change while the version does not.
"""

from __future__ import annotations

import hashlib
import os
import platform
from pathlib import Path

BEHAVIOUR_VERSION = 11


def code_version() -> str:
    """The code that results depend on (world, agents, referee, recorder), in one word."""
    return f"behaviour-{BEHAVIOUR_VERSION}"


def file_digest(path: Path) -> str:
    """Tells a file from any other."""
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16]


def machine_name() -> str:
    """The processor in words, and how many cores it has."""
    info = Path("/proc/cpuinfo").read_text() if Path("/proc/cpuinfo").is_file() else ""
    names = [line.partition(":")[2].strip() for line in info.splitlines() if line.startswith("model name")]
    return f"{names[0] if names else platform.processor() or platform.machine()}, {os.cpu_count()} cores"
