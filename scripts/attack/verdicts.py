"""Sorts the outcomes of attempts."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from scripts.attack.attempt import Attempt
from scripts.attack.outputs import NO_NUMBER, Files, impossible, leaves, leftovers, strict_json, torn
from scripts.attack.runner import CRASHED, Ended

PROGRESS = re.compile(r" \(\d+%\)$")  # how far it has come, in a line now and then
LONGEST = 4000  # letters of a sentence, as it may name what was typed


class Outcome(Enum):
    """What became of an input; all but the first two are faults."""

    RAN = "ran"
    REFUSED = "refused in one sentence"
    UGLY = "refused otherwise"
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
    """An outcome, and what was seen that makes it one."""

    outcome: Outcome
    why: str = ""


def verdict(attempt: Attempt, ended: Ended, work: Path, before: Files) -> Verdict:
    """What became of an attempt. before: the files of its folder before it ran."""
    found = _stopped(ended) or _broken_off(ended) or _left(ended, work, before)
    if found is not None:
        return found
    if ended.code == 2:
        why = _no_sentence(ended, "--json" in attempt.arguments)
        return Verdict(Outcome.UGLY, why) if why else Verdict(Outcome.REFUSED)
    return _nonsense(attempt, ended, work, before) or Verdict(Outcome.RAN)


def _stopped(ended: Ended) -> Verdict | None:
    if ended.stopped == "time" and PROGRESS.search(ended.stderr.strip()):
        return Verdict(Outcome.RAN, "long work that says how far it is")  # such as 1,800 episodes, by empty settings
    if ended.stopped:
        outcome = Outcome.HANG if ended.stopped == "time" else Outcome.MEMORY
        return Verdict(outcome, f"stopped after {ended.seconds:.0f} s, {ended.cpu:.0f} s of a processor")
    if ended.orphans:
        return Verdict(Outcome.HANG, f"{ended.orphans} processes are left behind")
    if "found too little memory" in ended.stderr or "bad_alloc" in ended.stderr:
        return Verdict(Outcome.MEMORY, "it asked for more than there is")
    return None


def _broken_off(ended: Ended) -> Verdict | None:
    for words in ("Traceback (most recent call last)", "found a fault of the program"):
        if words in ended.stderr + ended.stdout:
            return Verdict(Outcome.TRACEBACK, words)
    if ended.code < 0 or ended.code == CRASHED:
        return Verdict(Outcome.TRACEBACK, f"exit code {ended.code}")
    return None if ended.code in (0, 1, 2) else Verdict(Outcome.UGLY, f"exit code {ended.code}")


def _left(ended: Ended, work: Path, before: Files) -> Verdict | None:
    """Whether something half-written lies about."""
    for why in (*leftovers(work.parent), *torn(work, before)):
        return Verdict(Outcome.HALF, why)
    return None


def _no_sentence(ended: Ended, as_json: bool) -> str:
    """How a refusal is not one sentence, for people and, where JSON was asked for, for programs."""
    lines = [line for line in ended.stderr.split("\n") if line.strip() and not PROGRESS.search(line)]
    if len(lines) != 1 or not lines[0].startswith("caldrive: "):
        return f"{len(lines)} lines on stderr"
    if not lines[0].isprintable():
        return "letters that cannot be printed"
    if len(lines[0]) > LONGEST or len(lines[0]) < 20:
        return f"a sentence of {len(lines[0])} letters"
    if not as_json:
        return "something on stdout" if ended.stdout.strip() else ""
    try:
        return "" if strict_json(ended.stdout).keys() == {"error"} else "no error in the JSON"
    except (ValueError, AttributeError):
        return "no JSON"


def _nonsense(attempt: Attempt, ended: Ended, work: Path, before: Files) -> Verdict | None:
    """Whether what ran must not have run, or says what cannot be."""
    if attempt.bad and ended.code == 0:
        return Verdict(Outcome.NONSENSE, f"accepted: {attempt.bad}")
    for why in impossible(work, before):
        return Verdict(Outcome.NONSENSE, why)
    if "--json" in attempt.arguments:
        try:
            list(leaves(strict_json(ended.stdout)))
        except ValueError as error:
            return Verdict(Outcome.NONSENSE, f"stdout: {error}")
    elif (found := NO_NUMBER.search(ended.stdout)) and found.group() not in " ".join(attempt.arguments):
        return Verdict(Outcome.NONSENSE, f"stdout says {found.group()}")
    return None


def table(counts: Counter[tuple[str, Outcome]]) -> str:
    """Kinds down, outcomes across."""
    kinds = sorted({kind for kind, _ in counts})
    rows = [["", *(outcome.value for outcome in Outcome)]]
    rows += [[kind, *(str(counts[kind, outcome] or "") for outcome in Outcome)] for kind in kinds]
    rows.append(["all", *(str(sum(counts[kind, outcome] for kind in kinds) or "") for outcome in Outcome)])
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    return "\n".join("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in rows)
