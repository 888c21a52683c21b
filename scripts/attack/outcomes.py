"""Runs one command line in a child process with limits, and says what became of it."""

from __future__ import annotations

import os
import resource
import signal
import time
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

SECONDS, GIGABYTES, FILE_SIZE = 60.0, 4.0, 2_000_000_000  # limits of a child
KEPT_TEXT = 600  # characters of what was said


class Outcome(Enum):
    """What became of an input; the last six are faults."""

    RAN = "ran"
    REFUSED = "refused in one sentence"
    UGLY = "refused in another way"
    TRACEBACK = "traceback"
    HANG = "hang"
    MEMORY = "too much memory"
    HALF = "half-written files"
    NONSENSE = "silent nonsense"

    @property
    def fault(self) -> bool:
        return self not in (Outcome.RAN, Outcome.REFUSED)


@dataclass(frozen=True)
class Verdict:
    """How an input ended: outcome, seconds, and the beginning of what was said."""

    outcome: Outcome
    seconds: float
    said: str


def run(arguments: Sequence[str], folder: Path, bad: bool) -> Verdict:
    """Forks, as loading the program anew each time would take longer than most inputs do.

    folder: where the child works; bad: whether to run at all would be silent nonsense.
    """
    began = time.monotonic()
    child = os.fork()
    if child == 0:
        _be_the_child(arguments, folder)
    end, status = _wait(child, began + SECONDS)
    seconds = time.monotonic() - began
    said = "".join((folder / name).read_text(errors="replace") for name in ("stdout.txt", "stderr.txt"))
    outcome = end or _judged(status, said, folder, bad)
    return Verdict(outcome, seconds, said[-KEPT_TEXT:])


def _be_the_child(arguments: Sequence[str], folder: Path) -> None:
    """Never returns."""
    code = 99
    try:
        os.setsid()
        os.chdir(folder)
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_FSIZE, (FILE_SIZE, FILE_SIZE))
        for number, name in ((1, "stdout.txt"), (2, "stderr.txt")):
            os.dup2(os.open(folder / name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644), number)
        from caldrive.cli import main

        code = main(list(arguments))
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 1
    except BaseException:
        import traceback

        traceback.print_exc()
        code = 98
    finally:
        for stream in (1, 2):
            os.fsync(stream)
        import sys

        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def _wait(child: int, until: float) -> tuple[Outcome | None, int]:
    """Waits for the child; kills it where it takes too long or too much."""
    while True:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return None, status
        late, large = time.monotonic() > until, _memory(child) > GIGABYTES * 1e9
        if late or large:
            os.killpg(child, signal.SIGKILL)
            os.waitpid(child, 0)
            return Outcome.HANG if late else Outcome.MEMORY, 0
        time.sleep(0.01)


def _memory(child: int) -> int:
    """Bytes that the child holds, its own children left aside."""
    try:
        pages = int(Path(f"/proc/{child}/statm").read_text().split()[1])
    except (OSError, IndexError):
        return 0
    return pages * os.sysconf("SC_PAGE_SIZE")


def _judged(status: int, said: str, folder: Path, bad: bool) -> Outcome:
    """By its exit code, what it said and what it left."""
    code = os.waitstatus_to_exitcode(status)
    if "Traceback (most recent call last)" in said:
        return Outcome.TRACEBACK
    if code == 2:
        lines = [line for line in (folder / "stderr.txt").read_text(errors="replace").splitlines() if line.strip()]
        whole = len(lines) == 1 and lines[0].startswith("caldrive: ") and len(lines[0]) > 20
        return _tidy(folder) or (Outcome.REFUSED if whole else Outcome.UGLY)
    if code not in (0, 1):
        return Outcome.UGLY
    return _tidy(folder) or (Outcome.NONSENSE if bad and code == 0 else Outcome.RAN)


def _tidy(folder: Path) -> Outcome | None:
    """Whether something half-written lies about."""
    return Outcome.HALF if any(folder.rglob(".*.tmp")) else None
