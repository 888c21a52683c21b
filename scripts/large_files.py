"""Refuses files over 1 MB: what is committed once stays in the repository's history for ever.

    python scripts/large_files.py [FILE ...]

Without names it looks at all files that git keeps. HTML reports and recordings are made, not committed;
lines of results are compressed; the network's file is committed once a release.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
LIMIT = 1_000_000  # bytes
KNOWN = {"src/caldrive/models/cal.safetensors"}  # the network that ships


def kept_files() -> list[str]:
    """What git keeps here. Raises SystemExit where git does not say."""
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=False)
    if listed.returncode != 0:
        raise SystemExit(
            f"found that git lists no files ({listed.stderr.strip()}), wanted a repository: name the files"
        )
    return [name for name in listed.stdout.split("\0") if name]


def too_large(names: list[str], root: Path = ROOT) -> list[str]:
    """A sentence for each file that is over the limit and not known."""
    sizes = {name: (root / name).stat().st_size for name in names if (root / name).is_file() and name not in KNOWN}
    return [
        f"found {name} with {size / 1e6:.1f} MB, wanted at most {LIMIT / 1e6:g} MB: leave it out of git, or compress it"
        for name, size in sorted(sizes.items())
        if size > LIMIT
    ]


def main() -> int:
    if not sys.argv[1:] and not (ROOT / ".git").exists():
        print("no repository, so nothing that it keeps for ever")
        return 0
    names = sys.argv[1:] or kept_files()
    sentences = too_large(names)
    print("\n".join(sentences) or f"{len(names)} files, none over 1 MB but the known ones")
    return int(bool(sentences))


if __name__ == "__main__":
    sys.exit(main())
