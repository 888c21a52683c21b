"""The command line: parses, runs one command, prints what it found or what went wrong.

Exit codes: 0 for success, 1 where a check that was asked for says no, 2 for an error, 130 after Ctrl-C.
"""

from __future__ import annotations

import errno
import io
import json
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stderr
from typing import Any

import tyro

from caldrive.commands import Answer, Command
from caldrive.progress import Progress, silent

DESCRIPTION = "Conditional Affordance Learning for urban driving: one camera, six affordances, one controller."
FULL = (errno.ENOSPC, errno.EDQUOT)
STYLE = (tyro.conf.FlagCreatePairsOff, tyro.conf.DisallowNone)  # --json and no --no-json; --cap 20 and no --cap None


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command and returns its exit code."""
    try:
        command = _parse(arguments)
        with _progress() as progress:
            answer: Answer = command.run(progress)
        _print(answer, command.json)
        return answer.code
    except KeyboardInterrupt:
        print("caldrive: stopped by Ctrl-C", file=sys.stderr)
        return 130
    except (ValueError, OSError, RuntimeError) as error:
        if os.environ.get("CALDRIVE_TRACEBACK"):  # for those who look for the cause in the code
            raise
        print(f"caldrive: {_sentence(error)}", file=sys.stderr)
        return 2


def _parse(arguments: Sequence[str] | None) -> Any:
    """The command, or exit with one sentence in place of the parser's box."""
    said = io.StringIO()
    try:
        with redirect_stderr(said):
            return tyro.cli(Command, prog="caldrive", description=DESCRIPTION, args=arguments, config=STYLE)
    except SystemExit as end:
        if end.code:
            raise ValueError(_first_message(said.getvalue())) from end
        raise


def _first_message(box: str) -> str:
    """The text in the upper part of a box that the parser has drawn."""
    lines = [line.strip("│ \n") for line in box.splitlines()[1:]]
    end = next((i for i, line in enumerate(lines) if not line.strip("─╰╯")), len(lines))
    return " ".join(lines[:end]).rstrip(".") + ": type caldrive --help"


def _sentence(error: Exception) -> str:
    """An error in one line."""
    if isinstance(error, OSError) and error.errno in FULL:
        return f"found no room on the disk for {error.filename or 'a file'}, wanted some: make room, and type it again"
    if isinstance(error, OSError) and error.strerror and error.filename:
        return f"found that {error.filename} is no use ({error.strerror.lower()}), wanted one that is: give another"
    return " ".join(str(error).split()) or type(error).__name__


@contextmanager
def _progress() -> Iterator[Progress]:
    """A bar on stderr, where people sit before it."""
    if not sys.stderr.isatty():
        yield silent
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("starting", total=1.0)
        yield lambda label, share: bar.update(task, description=label, completed=share)


def _print(answer: Answer, as_json: bool) -> None:
    if as_json:
        print(json.dumps(answer.values, allow_nan=False))
        return
    from rich.console import Console

    console = Console()
    if not console.is_terminal:
        console.width = 200  # a table takes what it needs; at the 80 columns that a file gets it would lose digits
    console.print(answer.shown, highlight=False, soft_wrap=isinstance(answer.shown, str))
