"""A campaign: many attempts one after the other, each in a folder of its own, written down as they are done."""

from __future__ import annotations

import json
import shutil
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from scripts.attack.attempt import WORK, Attempt, fresh, keep, lay_out
from scripts.attack.good import WORK_MARK, good_files
from scripts.attack.outputs import snapshot
from scripts.attack.runner import Ended, Limits, run
from scripts.attack.uses import USES
from scripts.attack.verdicts import Outcome, Verdict, table, verdict
from scripts.attack.words import BASES

LINES, SUMMARY = "attempts.jsonl", "summary.json"


@dataclass(frozen=True)
class Row:
    """What is written down of every attempt; cpu and seconds as in `Ended`."""

    number: int
    kind: str
    outcome: str
    why: str
    seconds: float
    cpu: float
    line: str


def tried(attempt: Attempt, folder: Path, limits: Limits) -> tuple[Ended, Verdict]:
    """Runs an attempt in an empty folder, and judges it."""
    work = lay_out(_placed(attempt, folder), folder)
    before = snapshot(work)
    ended = run(attempt.arguments, work, limits)
    return ended, verdict(attempt, ended, work, before)


def _placed(attempt: Attempt, folder: Path) -> Attempt:
    """The attempt with the files that name their own place put right."""
    here = str((folder / WORK).resolve()).encode()
    files = {name: content.replace(WORK_MARK, here) for name, content in attempt.files.items()}
    return Attempt(attempt.kind, attempt.arguments, files, attempt.bad)


def make_good(out: Path, kinds: Sequence[str], limits: Limits) -> dict[str, bytes]:
    """The good inputs of some kinds in a campaign's folder. Raises RuntimeError where the program refuses one."""
    folder = out / "making"

    def call(attempt: Attempt) -> tuple[int, str, Path]:
        ended, found = tried(attempt, fresh(folder), limits)
        code = 1 if found.outcome.fault else ended.code
        return code, f"{found.outcome.value} {found.why}: {ended.stderr[-1000:]}", (folder / WORK).resolve()

    files = good_files(out / "good", call, kinds, (*USES, *BASES))
    shutil.rmtree(folder, ignore_errors=True)
    return files


def take(number: int, attempt: Attempt, out: Path, limits: Limits) -> Row:
    """Runs one attempt of a campaign; its folder stays where there was a fault."""
    folder = fresh(out / f"{number:05d}")
    ended, found = tried(attempt, folder, limits)
    line = " ".join(word if len(word) < 100 else f"{word[:20]}..." for word in attempt.arguments)
    row = Row(number, attempt.kind, found.outcome.name, found.why, round(ended.seconds, 2), round(ended.cpu, 2), line)
    if found.outcome.fault:
        said = {"stdout": ended.stdout[-2000:], "stderr": ended.stderr[-6000:], "code": ended.code}
        keep(attempt, folder, asdict(row) | said)
    else:
        shutil.rmtree(folder)
    with (out / LINES).open("a") as file:  # lanes share it: a line is written at once
        file.write(json.dumps(asdict(row)) + "\n")
    return row


def rows(out: Path) -> list[Row]:
    """All that a campaign wrote down so far."""
    path = out / LINES
    return [Row(**json.loads(line)) for line in path.read_text().splitlines()] if path.is_file() else []


def summary(done: list[Row], minutes: float) -> str:
    """The table, and how fast it went."""
    counts = Counter((row.kind, Outcome[row.outcome]) for row in done)
    cpu = sum(row.cpu for row in done) / max(1, len(done))
    pace = f"{len(done)} inputs, {cpu:.2f} s of a processor each"
    return f"{table(counts)}\n{pace}" + (f", {60 * len(done) / minutes:.0f} an hour" if minutes else "")


def faults(done: list[Row]) -> Iterator[Row]:
    """Those that were neither run nor refused as they should."""
    return (row for row in done if Outcome[row.outcome].fault)
