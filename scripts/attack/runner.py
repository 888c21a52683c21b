"""Runs one command line in a child process with limits of time, memory and file size.

The child is forked from this process, in which the program is loaded: to load it anew takes longer than most inputs do.
Neither SUMO nor a GL context nor a thread may have been started before.
"""

from __future__ import annotations

import atexit
import os
import resource
import signal
import sys
import time
import traceback
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

TICK = 0.05  # s between two looks at a child
GRACE = 3.0  # s that a child's own children have to end after it
CRASHED = 98  # exit code where an exception came through all doors


@dataclass(frozen=True)
class Limits:
    """Of a child and its own children together; seconds by the clock are many, as others use the machine, too."""

    seconds: float = 600.0
    cpu_seconds: float = 15.0
    gigabytes: float = 4.0
    address_space: float = 16e9
    file_size: int = 1_000_000_000


@dataclass(frozen=True)
class Ended:
    """How a child ended. code: of its exit, negative for a signal; stopped: the limit that it broke, or nothing;
    cpu: seconds of processor time; orphans: processes that it left behind."""

    code: int
    stopped: str
    seconds: float
    cpu: float
    stdout: str
    stderr: str
    orphans: int = 0


def load_the_program() -> None:
    """All that commands load when they run, so that children need not, and the town that most of them drive in."""
    os.environ["OMP_NUM_THREADS"] = "1"
    import caldrive.benchmark.replay
    import caldrive.benchmark.report.page
    import caldrive.benchmark.runner
    import caldrive.cli
    import caldrive.collection.collect
    import caldrive.driving.determinism
    import caldrive.driving.drive
    import caldrive.driving.see
    import caldrive.driving.speed
    import caldrive.perception.evaluation.report
    import caldrive.perception.inference.predictor
    import caldrive.perception.training.train
    import caldrive.recordings.check
    import caldrive.visualization.contact_sheet
    import caldrive.visualization.town_plan
    import caldrive.world.embedded  # noqa: F401
    from caldrive.world.town import load_town

    load_town("town01")


def run(arguments: Sequence[str], work: Path, limits: Limits) -> Ended:
    """Runs a command line in a folder; what it says lies beside that folder, in stdout.txt and stderr.txt."""
    sys.stdout.flush()
    began = time.monotonic()
    child = os.fork()
    if child == 0:
        _be_the_child(arguments, work, limits)
    stopped = ""
    while not (done := os.wait4(child, os.WNOHANG))[0]:
        stopped = stopped or _broken_limit(child, time.monotonic() - began, limits)
        if stopped:
            os.killpg(child, signal.SIGKILL)
        time.sleep(TICK if time.monotonic() - began > 0.2 else 0.005)
    _, status, used = done
    orphans = _end_orphans(child)
    said = [(work.parent / name).read_text(errors="replace") for name in ("stdout.txt", "stderr.txt")]
    return Ended(
        code=os.waitstatus_to_exitcode(status), stopped=stopped, seconds=time.monotonic() - began,
        cpu=used.ru_utime + used.ru_stime, stdout=said[0], stderr=said[1], orphans=orphans,
    )  # fmt: skip


def _be_the_child(arguments: Sequence[str], work: Path, limits: Limits) -> None:
    """Never returns: whatever happens, no child may go on as a second parent."""
    code = CRASHED
    try:
        confine(work, work.parent, limits)
        from caldrive.cli import main

        code = main(list(arguments))
        atexit._run_exitfuncs()
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 1
    except BaseException:
        traceback.print_exc()
    finally:
        leave(code)


def leave(code: int) -> NoReturn:
    """Ends a forked child with what it said, and without what its parent wanted done at its own end."""
    try:
        sys.stdout.flush()
        sys.stderr.flush()
    finally:
        os._exit(code)


def confine(work: Path, beside: Path, limits: Limits) -> None:
    """Gives this process a session, a place to work and limits. What it says, its temporary files and its cache lie in
    another folder."""
    os.setsid()
    os.chdir(work)
    temporary = beside / "tmp"
    temporary.mkdir()
    os.environ |= {"TMPDIR": str(temporary), "XDG_CACHE_HOME": str(beside / "cache")}
    for limit, most in (
        (resource.RLIMIT_CORE, 0), (resource.RLIMIT_FSIZE, limits.file_size),
        (resource.RLIMIT_AS, int(limits.address_space)),
    ):  # fmt: skip
        resource.setrlimit(limit, (most, most))
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    for number, name in ((1, "stdout.txt"), (2, "stderr.txt")):
        os.dup2(os.open(beside / name, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644), number)


def _broken_limit(session: int, seconds: float, limits: Limits) -> str:
    stats = [stat for process in _members(session) if (stat := _stat(process))]
    ticks, pages = os.sysconf("SC_CLK_TCK"), os.sysconf("SC_PAGE_SIZE")
    if seconds > limits.seconds or sum(int(stat[11]) + int(stat[12]) for stat in stats) / ticks > limits.cpu_seconds:
        return "time"
    return "memory" if sum(int(stat[21]) for stat in stats) * pages > limits.gigabytes * 1e9 else ""


def _members(session: int) -> list[int]:
    """The processes of a session."""
    numbers = (int(name) for name in os.listdir("/proc") if name.isdigit())
    return [number for number in numbers if (stat := _stat(number)) and int(stat[3]) == session and stat[0] != "Z"]


def _stat(process: int) -> list[str]:
    """/proc/PROCESS/stat from the state on, nothing for a process that is gone."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return []


def _end_orphans(session: int) -> int:
    """Ends what a child left running, and says how many processes these were."""
    until = time.monotonic() + GRACE
    while (orphans := _members(session)) and time.monotonic() < until:
        time.sleep(TICK)
    for process in orphans:
        os.kill(process, signal.SIGKILL)
    return len(orphans)
