"""Kills a benchmark with SIGKILL at random moments, lets it go on each time, and compares it with an unbroken run.

    python scripts/kill_and_resume.py [--kills 20] [--seed 0] [--out out/kills] [arguments of caldrive benchmark]

Ends with exit code 0 where both runs hold the same lines and print the same tables.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path


def start(out: Path, arguments: list[str]) -> subprocess.Popen[bytes]:
    """A benchmark in a process group of its own, so that its workers die with it."""
    command = [sys.executable, "-m", "caldrive", "benchmark", "--out", str(out), *arguments]
    return subprocess.Popen(command, stdout=subprocess.PIPE, start_new_session=True)


def lines(out: Path) -> list[bytes]:
    path = out / "results.jsonl"
    return sorted(path.read_bytes().splitlines()) if path.is_file() else []


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--longest", type=float, default=12.0, help="seconds until a run is killed, at most")
    parser.add_argument("--out", type=Path, default=Path("out/kills"))
    options, arguments = parser.parse_known_args()
    arguments = arguments or ["--suite", "quick", "--agent", "oracle"]
    rng, broken, whole = random.Random(options.seed), options.out / "broken", options.out / "whole"
    for k in range(options.kills):
        process = start(broken, arguments)
        time.sleep(rng.uniform(0.2, options.longest))
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        print(f"killed {k + 1} times, {len(lines(broken))} episodes done", flush=True)
    said = [start(out, arguments).communicate()[0] for out in (broken, whole)]
    said = [text.replace(str(out).encode(), b"DIR") for text, out in zip(said, (broken, whole), strict=True)]
    same_lines, same_tables = lines(broken) == lines(whole), said[0] == said[1]
    print(f"{len(lines(whole))} episodes; same lines: {same_lines}; same tables: {same_tables}")
    return int(not (same_lines and same_tables))


if __name__ == "__main__":
    sys.exit(main())
