"""Stops collect, train, benchmark and report again and again, lets them go on, and compares all files with an unbroken
run's.

    python -m scripts.kill_and_resume [--kills 50] [--verbs collect train] [--seed 0] [--out out/kills]

A run is stopped in one of three ways, in turn: by SIGKILL at a random moment; by SIGKILL between two calls with which
files are written; and by a disk that is full (a small one of its own where this user may mount one; else files may only
grow to a random size). Ends with 0 where all files are the same and every full disk was named in one sentence.
"""

from __future__ import annotations

import argparse
import os
import random
import re
import shutil
import signal
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from scripts.attack.attempt import fresh, tree
from scripts.attack.good import written_by_hand
from scripts.attack.runner import Limits, confine, leave, load_the_program
from scripts.small_disk import SmallDisk

WAYS = ("clock", "write", "full")
# Lines that say when and how fast something was done differ between any two runs, and so does where it lies.
EXEMPT = (rb'"began": "[^"]*"', rb'"(windows|steps)_per_s": [\d.e+-]+', rb'"suite": "/[^"]*"')

SMALL = "--steps 4 --batch 6 --save-every 1 --evaluate-every 2 --device cpu --precision fp32 --validation-share 0.5"


@dataclass(frozen=True)
class Work:
    """What is stopped. out: the folder that it fills; needs: what it reads."""

    verb: str
    line: str
    out: str
    needs: tuple[str, ...]


WORKS = (
    Work("collect", "collect --out recording --config recording.toml --workers 1 --episodes 4 --duration 1",
         "recording", ("recording.toml",)),
    Work("train", "train --data recording --out training --config training.toml --steps 6 --history-steps 4"
         " --evaluate-every 3", "training", ("recording", "training.toml")),
    Work("collect-turns", "collect --out turns --config recording.toml --workers 1 --episodes 32 --duration 4"
         " --width 96 --height 96", "turns", ("recording.toml",)),
    Work("train-cil", f"train --agent cil --data turns --out cil {SMALL} --network.nodes 16"
         " --network.image-width 96 --network.image-height 96", "cil", ("turns",)),
    Work("train-mp", f"train --agent mp --data turns --out mp {SMALL} --network.width 0.125"
         " --network.image-width 96 --network.image-height 96", "mp", ("turns",)),
    Work("train-rl", "train --agent rl --preset affordances --out rl --processes False --environments 1"
         " --steps 64 --rollout 16 --batch 16 --epochs 1 --hidden 8 --save-every 1 --device cpu", "rl", ()),
    Work("benchmark", "benchmark --suite suite.json --agent oracle --workers 1 --out run", "run", ("suite.json",)),
    Work("report", "report run --out report", "report", ("run", "suite.json")),
)  # fmt: skip


@dataclass
class Tally:
    """What was seen of one verb."""

    kills: int = 0
    full: int = 0  # disks that were full, of the kills
    rounds: int = 0  # runs from nothing to the end
    faults: tuple[str, ...] = ()


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=50, help="of all verbs together")
    parser.add_argument("--verbs", nargs="+", choices=[work.verb for work in WORKS], default=[w.verb for w in WORKS])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=Path("out/kills"))
    options = parser.parse_args(arguments)
    load_the_program()
    whole, tallies = fresh(options.out / "whole" / "here").resolve(), dict[str, Tally]()
    for name, content in written_by_hand().items():
        _write(whole / name, content)
    for work in needed_for(options.verbs):
        seconds = _unbroken(work, whole)
        if work.verb in options.verbs:
            with SmallDisk(options.out / "broken") as disk:
                kills = share(options.kills, options.verbs.index(work.verb), len(options.verbs))
                tallies[work.verb] = stop_again_and_again(
                    work, whole, disk, kills, seconds, random.Random(f"{options.seed} {work.verb}")
                )
            print(row(work.verb, tallies[work.verb]), flush=True)
    return int(any(tally.faults for tally in tallies.values()))


def needed_for(verbs: Sequence[str]) -> list[Work]:
    """Some verbs' works, and before them those that make what they read."""
    wanted = [work for work in WORKS if work.verb in verbs]
    needs = {need for work in wanted for need in work.needs}
    return [work for work in WORKS if work in wanted or work.out in needs]


def share(total: int, k: int, of: int) -> int:
    """The k-th of so many equal parts, which are whole numbers."""
    return total * (k + 1) // of - total * k // of


def row(verb: str, tally: Tally) -> str:
    ended = f"{tally.kills} times stopped, {tally.full} of them by a full disk, {tally.rounds} times finished"
    return f"{verb:<10} {ended}: " + ("; ".join(tally.faults) or "the same files")


def stop_again_and_again(
    work: Work, whole: Path, disk: SmallDisk, kills: int, seconds: float, rng: random.Random
) -> Tally:
    """Stops a work so many times; each time that it is finished in between, it is compared and begun anew.

    seconds: that the work takes when nobody stops it.
    """
    tally = Tally()
    while tally.kills < kills or not tally.rounds:
        here = disk.emptied()
        for need in work.needs:
            _copy(whole / need, here / need)
        tally.rounds += 1
        while tally.kills < kills and not _stopped_once(work, disk, seconds, rng, tally):
            pass
        code, said = Run(work, here).wait()
        tally.faults += () if code == 0 else (f"exit code {code} in the end: {said.strip()[-300:]}",)
        tally.faults += differences(whole / work.out, here / work.out)
    return tally


def _stopped_once(work: Work, disk: SmallDisk, seconds: float, rng: random.Random, tally: Tally) -> bool:
    """Stops a work in the next way; returns whether it came to its end all the same."""
    way = WAYS[(tally.kills + tally.rounds) % len(WAYS)]
    if way == "clock":
        code, said = Run(work, disk.path).wait(rng.uniform(0.0, seconds))
    elif way == "write":
        code, said = Run(work, disk.path, _killed_at_a_write(rng.randrange(1, 2 * len(tree(disk.path)) + 8))).wait()
    else:
        with disk.almost_full(int(10 ** rng.uniform(0, 5.5))) as limits:
            code, said = Run(work, disk.path, limits=limits).wait()
    if code == 0:
        return True
    tally.kills += 1
    if way == "full":
        tally.full += 1
        tally.faults += () if code == 2 and named_as_full(said) else (f"full disk: exit code {code}, {said[-300:]!r}",)
    elif code != -signal.SIGKILL:
        tally.faults += (f"exit code {code}: {said.strip()[-300:]}",)
    return False


def named_as_full(said: str) -> bool:
    """Whether a full disk was named, in one sentence."""
    return len(said.strip().splitlines()) == 1 and ("no room on the disk" in said or "file too large" in said)


class Run:
    """A child process that does a work in a folder. before: what it does first. What it says lies elsewhere, as the
    folder's disk may be full."""

    def __init__(
        self, work: Work, here: Path, before: Callable[[], None] | None = None, limits: Limits | None = None
    ) -> None:
        self.beside = fresh(here.parents[1] / "said")
        sys.stdout.flush()
        self.process = os.fork()
        if self.process == 0:
            self._be_the_child(work, here, before, limits or Limits())

    def _be_the_child(self, work: Work, here: Path, before: Callable[[], None] | None, limits: Limits) -> None:
        code = 99
        try:
            confine(here, self.beside, limits)
            if before is not None:
                before()
            from caldrive.cli import main

            code = main(work.line.split())
        finally:
            leave(code)

    def wait(self, kill_after: float | None = None) -> tuple[int, str]:
        """Waits for its end, or kills it after some seconds; its exit code, and what it said."""
        began = time.monotonic()
        while not (done := os.waitpid(self.process, os.WNOHANG))[0]:
            if kill_after is not None and time.monotonic() - began > kill_after:
                os.kill(self.process, signal.SIGKILL)
            time.sleep(0.002)
        return os.waitstatus_to_exitcode(done[1]), (self.beside / "stderr.txt").read_text(errors="replace")


def _killed_at_a_write(number: int) -> Callable[[], None]:
    """Kills a process before or after one of its calls of fsync and replace, the so many-th of these moments."""
    moments = iter(range(1, number))

    def live_or_die() -> None:
        if next(moments, None) is None:
            os.kill(os.getpid(), signal.SIGKILL)

    def watched(call: Callable[..., None]) -> Callable[..., None]:
        def between(*arguments: object) -> None:
            live_or_die()
            call(*arguments)
            live_or_die()

        return between

    def before() -> None:
        os.fsync, os.replace = watched(os.fsync), watched(os.replace)

    return before


def differences(whole: Path, broken: Path) -> tuple[str, ...]:
    """How a folder differs from an unbroken run's, but for what is exempt; nothing where it does not."""
    files = [{name: _comparable(content) for name, content in tree(folder).items()} for folder in (whole, broken)]
    names = sorted(files[0].keys() | files[1].keys())
    return tuple(
        f"{name} {'differs' if name in files[0] and name in files[1] else 'is there only once'}"
        for name in names
        if files[0].get(name) != files[1].get(name)
    )


def _comparable(content: bytes) -> bytes:
    for pattern in EXEMPT:
        content = re.sub(pattern, b"", content)
    return content


def _unbroken(work: Work, whole: Path) -> float:
    """Does a work without a stop, and returns how many seconds it took."""
    began = time.monotonic()
    code, said = Run(work, whole).wait()
    if code:
        raise RuntimeError(f"caldrive {work.line} ends with {code}: {said}")
    return time.monotonic() - began


def _copy(source: Path, target: Path) -> None:
    shutil.copytree(source, target) if source.is_dir() else shutil.copy(source, target)


def _write(path: Path, content: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)


if __name__ == "__main__":
    sys.exit(main())
