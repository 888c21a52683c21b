"""Drives the same minute from the camera again and again, and compares: is the program reliable on this machine?

    python scripts/repeat_drive.py [--times 20] [--out out/repeat] [arguments of caldrive drive]

Each drive is a process of its own. Ends with exit code 0 where every drive ended well and all left the same trace, byte
for byte.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from pathlib import Path

from caldrive.provenance import file_digest

DRIVE = [
    "--town", "town02", "--weather", "14", "--task", "navigation-dynamic", "--cap", "20", "--seconds", "60",
    "--no-video",
]  # fmt: skip


def drive(out: Path, arguments: list[str]) -> str:
    """Drives once; a digest of the trace. Raises SystemExit where the drive ended with an error."""
    command = [sys.executable, "-m", "caldrive", "drive", "--out", str(out), *arguments]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    if ended.returncode != 0:
        raise SystemExit(f"found that a drive ended with code {ended.returncode}: {ended.stderr.strip()}")
    return file_digest(out / "episode-000.json")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--times", type=int, default=20)
    parser.add_argument("--out", type=Path, default=Path("out/repeat"))
    options, arguments = parser.parse_known_args()
    digests = set[str]()
    for k in range(options.times):
        began = time.perf_counter()
        digest = drive(options.out, arguments or DRIVE)
        digests.add(digest)
        print(f"{k + 1} of {options.times}: {time.perf_counter() - began:.1f} s, trace {digest}", flush=True)
    print("all alike" if len(digests) == 1 else f"found {len(digests)} different traces, wanted one")
    return int(len(digests) != 1)


if __name__ == "__main__":
    sys.exit(main())
