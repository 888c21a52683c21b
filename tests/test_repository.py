"""What the repository keeps: no large files but the known ones."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from tests.documentation import ROOT

SCRIPT = ROOT / "scripts" / "large_files.py"


def look(*names: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, SCRIPT, *names], capture_output=True, text=True, check=False)


def test_what_git_keeps_is_small_but_for_what_is_known() -> None:
    found = look()
    assert found.returncode == 0, found.stdout


def test_a_large_file_is_refused_with_its_size(tmp_path: Path) -> None:
    large, small = tmp_path / "film.mp4", tmp_path / "small.txt"
    large.write_bytes(bytes(2_500_000))
    small.write_bytes(bytes(1_000_000))
    found = look(str(large), str(small))
    assert found.returncode == 1
    assert found.stdout.splitlines() == [
        f"found {large} with 2.5 MB, wanted at most 1 MB: leave it out of git, or compress it"
    ]
