"""Tries bad inputs of every kind on the program and sorts the outcomes.

    python -m scripts.attack [--inputs 2000] [--seed 0] [--out out/attack] [--only KIND]

Prints a table of kinds and outcomes, and keeps every fault's files in --out. Ends with 0 where there is no fault.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import shutil
import sys
import time
from collections import Counter
from itertools import islice
from pathlib import Path

from scripts.attack.inputs import Attempt, attempts, prepare
from scripts.attack.outcomes import Outcome, Verdict, run


def tried(number: int, attempt: Attempt, good: Path, out: Path) -> Verdict:
    """Runs an attempt in a folder of its own, which stays where there was a fault."""
    folder = out / f"{number:05d}"
    folder.mkdir(parents=True)
    for name, content in attempt.files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    words = [word.replace("{dir}", str(folder)).replace("{good}", str(good)) for word in attempt.arguments]
    verdict = run(words, folder, attempt.bad)
    if verdict.outcome.fault:
        about = {"kind": attempt.kind, "arguments": words, "outcome": verdict.outcome.value, "said": verdict.said}
        (folder / "fault.json").write_text(json.dumps(about, indent=1))
    else:
        shutil.rmtree(folder)
    return verdict


def table(counts: Counter[tuple[str, Outcome]]) -> str:
    """Kinds down, outcomes across."""
    kinds = sorted({kind for kind, _ in counts})
    rows = [["", *(outcome.value for outcome in Outcome)]]
    rows += [[kind, *(str(counts[kind, outcome] or "") for outcome in Outcome)] for kind in kinds]
    totals = (sum(counts[kind, outcome] for kind in kinds) for outcome in Outcome)
    rows.append(["all", *(str(total or "") for total in totals)])
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    return "\n".join("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in rows)


def load_the_program() -> None:
    """All that commands load when they run, so that children need not."""
    os.environ.setdefault("LP_NUM_THREADS", "0")
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    import caldrive.benchmark.report.page
    import caldrive.benchmark.runner
    import caldrive.cli
    import caldrive.collection.collect
    import caldrive.driving.drive
    import caldrive.perception.evaluation.report
    import caldrive.perception.inference.predictor
    import caldrive.perception.training.train
    import caldrive.recordings.check
    import caldrive.visualization.contact_sheet  # noqa: F401


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--inputs", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=Path("out/attack"))
    parser.add_argument("--only", help="one kind of input")
    options = parser.parse_args()
    load_the_program()
    good, faults = (options.out / "good").resolve(), (options.out / f"seed{options.seed}").resolve()
    shutil.rmtree(faults, ignore_errors=True)
    prepare(
        good, lambda words: 0 if run(words, _folder(options.out / "preparing"), False).outcome is Outcome.RAN else 1
    )
    stream = attempts(good, random.Random(options.seed))
    chosen = (attempt for attempt in stream if options.only in (None, attempt.kind))
    counts: Counter[tuple[str, Outcome]] = Counter()
    began = time.monotonic()
    for number, attempt in enumerate(islice(chosen, options.inputs)):
        verdict = tried(number, attempt, good, faults)
        counts[attempt.kind, verdict.outcome] += 1
        if verdict.outcome.fault or verdict.seconds > 20:
            words = " ".join(attempt.arguments)[:150]
            print(f"{number} {attempt.kind}: {verdict.outcome.value}, {verdict.seconds:.0f} s: {words}", flush=True)
    print(table(counts))
    print(f"{sum(counts.values())} inputs in {(time.monotonic() - began) / 60:.0f} minutes")
    return int(any(outcome.fault for _, outcome in counts))


def _folder(path: Path) -> Path:
    path.mkdir(parents=True, exist_ok=True)
    return path.resolve()


if __name__ == "__main__":
    sys.exit(main())
