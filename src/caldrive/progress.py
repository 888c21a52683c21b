"""What the terminal is told while work goes on: how far it is, and nothing that is not asked for."""

from __future__ import annotations

import os
import shutil
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

Progress = Callable[[str, float], None]  # what is being done, and the share of it that is done

NARROWEST, WIDEST = 40, 1000  # columns: in fewer, tyro's help never ends


@contextmanager
def readable_width() -> Iterator[None]:
    """Lets everybody who asks how wide the terminal is hear a number that text can be set in, whatever the terminal or
    COLUMNS say: 0, 1 or nonsense."""
    before = {name: os.environ.get(name) for name in ("COLUMNS", "LINES")}
    columns, lines = shutil.get_terminal_size()
    within = min(max(columns, NARROWEST), WIDEST)
    if before["COLUMNS"] is not None or within != columns:
        os.environ["COLUMNS"] = str(within)
    if before["LINES"] is not None:
        os.environ["LINES"] = str(lines)
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name, None)
            if value is not None:
                os.environ[name] = value


LINES_EVERY = 10.0  # s


def silent(label: str, share: float) -> None:
    """Progress that nobody follows."""


def progress_lines(clock: Callable[[], float] = time.monotonic) -> Progress:
    """Progress as a line on stderr now and then, as logs want it; work that takes a moment says nothing. clock: s."""
    last = clock()

    def say(label: str, share: float) -> None:
        nonlocal last
        if clock() - last >= LINES_EVERY:
            last = clock()
            with suppress(OSError, ValueError):  # nobody may listen any more
                print(f"{label} ({share:.0%})", file=sys.stderr, flush=True)

    return say


@contextmanager
def progress_bar() -> Iterator[Progress]:
    """A bar on stderr where people sit before it, lines elsewhere."""
    if sys.stderr is None or not sys.stderr.isatty():
        yield silent if sys.stderr is None else progress_lines()
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


@contextmanager
def only_answers_on_stdout() -> Iterator[None]:
    """Sends what libraries print meanwhile to stderr, from C code, too: stdout is for the answer, which may be JSON.

    Without a stdout or stderr of its own, as inside some other programs, nothing is moved.
    """
    try:
        out, err = sys.stdout.fileno(), sys.stderr.fileno()
        kept = os.dup(out)
    except (OSError, ValueError, AttributeError):
        yield
        return
    sys.stdout.flush()
    os.dup2(err, out)
    try:
        yield
    finally:
        sys.stdout.flush()
        os.dup2(kept, out)
        os.close(kept)
