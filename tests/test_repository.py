"""What the repository keeps: no large files but the known ones."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.documentation import ROOT

SCRIPT = ROOT / "scripts" / "large_files.py"
in_a_repository = pytest.mark.skipif(not (ROOT / ".git").exists(), reason="this is no git repository")


def look(*names: str, **variables: str) -> subprocess.CompletedProcess[str]:
    environment = os.environ | variables
    return subprocess.run(
        [sys.executable, SCRIPT, *names], capture_output=True, text=True, check=False, env=environment
    )


@in_a_repository
def test_what_git_keeps_is_small_but_for_what_is_known() -> None:
    found = look()
    assert found.returncode == 0, found.stdout
    assert int(found.stdout.split()[0]) > 300


@in_a_repository
def test_where_git_fails_nothing_is_called_small(tmp_path: Path) -> None:
    found = look(GIT_DIR=str(tmp_path))
    assert found.returncode == 1
    assert found.stderr.startswith("found that git lists no files")


def test_a_large_file_is_refused_with_its_size(tmp_path: Path) -> None:
    large, small = tmp_path / "film.mp4", tmp_path / "small.txt"
    large.write_bytes(bytes(2_500_000))
    small.write_bytes(bytes(1_000_000))
    found = look(str(large), str(small))
    assert found.returncode == 1
    assert found.stdout.splitlines() == [
        f"found {large} with 2.5 MB, wanted at most 1 MB: leave it out of git, or compress it"
    ]
