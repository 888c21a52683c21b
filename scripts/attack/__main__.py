"""Tries bad inputs of every kind on the program and sorts the outcomes.

    python -m scripts.attack [--minutes 60] [--inputs 2000] [--seed 0] [--kinds suite map] [--lanes 2] [--out DIR]
    python -m scripts.attack --replay out/attack/seed0/00123

Prints a table of kinds and outcomes. Every fault's files stay in --out, where --replay runs them again. A campaign that
was stopped goes on. Ends with 0 where there is no fault.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import sys
import tempfile
import time
import traceback
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from scripts.attack.attempt import kept
from scripts.attack.attempts import KINDS, Attempts
from scripts.attack.campaign import SUMMARY, Row, faults, make_good, rows, summary, take, tried
from scripts.attack.runner import Limits, load_the_program


def main(arguments: Sequence[str] | None = None) -> int:
    options = _parser().parse_args(arguments)
    load_the_program()
    if options.replay is not None:
        return _replay(options.replay)
    out = options.out.resolve() / f"seed{options.seed}"
    out.mkdir(parents=True, exist_ok=True)
    attempts = Attempts(options.seed, make_good(options.out.resolve(), options.kinds, Limits()), options.kinds)
    began = time.monotonic()
    done = {row.number for row in rows(out)}
    todo = [number for number in range(options.inputs) if number not in done]
    lanes = [_lane(todo[k :: options.lanes], attempts, out, began + 60 * options.minutes) for k in range(options.lanes)]
    broken = sum(os.waitpid(lane, 0)[1] != 0 for lane in lanes)
    found, minutes = rows(out), (time.monotonic() - began) / 60
    new = sum(row.number not in done for row in found)
    print(summary(found, minutes * len(found) / max(1, new)))
    bad = list(faults(found))
    (out / SUMMARY).write_text(json.dumps([asdict(row) for row in bad], indent=1) + "\n")
    return int(bool(bad or broken))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=60.0, help="no attempt begins after so many")
    parser.add_argument("--inputs", type=int, default=100_000, help="at most so many attempts")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=KINDS)
    parser.add_argument("--lanes", type=int, default=2, help="attempts at the same time")
    parser.add_argument("--out", type=Path, default=Path("out/attack"))
    parser.add_argument("--replay", type=Path, help="a fault's folder, to be run again")
    return parser


def _lane(numbers: list[int], attempts: Attempts, out: Path, until: float) -> int:
    """A process that takes some of the attempts, one after the other; returns its number."""
    sys.stdout.flush()
    if child := os.fork():
        return child
    code = 1
    try:
        for number in numbers:
            if time.monotonic() > until:
                break
            _say(take(number, attempts[number], out, Limits()))
        code = 0
    except BaseException:
        traceback.print_exc()  # nobody else would hear of it
    finally:
        sys.stdout.flush()
        os._exit(code)


def _say(row: Row) -> None:
    for fault in faults([row]):
        print(f"{fault.number} {fault.kind}: {fault.outcome}, {fault.why}: {fault.line[:200]}", flush=True)


def _replay(folder: Path) -> int:
    work = Path(tempfile.mkdtemp()).resolve()  # a TemporaryDirectory would be removed by the child, too, at its end
    try:
        ended, found = tried(kept(folder), work, Limits())
    finally:
        shutil.rmtree(work)
    print(ended.stdout + ended.stderr)
    print(f"{found.outcome.value} {found.why}, exit code {ended.code}, {ended.seconds:.1f} s")
    return int(found.outcome.fault)


if __name__ == "__main__":
    sys.exit(main())
