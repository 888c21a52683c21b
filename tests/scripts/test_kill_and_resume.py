"""Work that is stopped at any moment goes on to the same files: a short part of scripts/kill_and_resume.py."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from scripts.kill_and_resume import Tally, differences, named_as_full, needed_for, row, share
from tests.documentation import ROOT


def test_a_benchmark_that_is_killed_and_meets_a_full_disk_ends_with_the_same_files(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "scripts.kill_and_resume", "--verbs", "benchmark", "--kills", "2"]
    found = subprocess.run(
        [*command, "--seed", "1", "--out", str(tmp_path)], capture_output=True, text=True, check=False, cwd=ROOT
    )
    assert found.returncode == 0, found
    assert "2 times stopped" in found.stdout
    assert found.stdout.endswith(": the same files\n")


@pytest.mark.parametrize(
    ("name", "content", "found"),
    [
        ("a.json", b'{"began": "2026-01-01", "cap": 20}', ()),
        ("a.json", b'{"began": "2025-12-31", "cap": 21}', ("a.json differs",)),
        ("b.json", b'{"began": "2025-12-31", "cap": 20}', ("a.json is there only once", "b.json is there only once")),
    ],
)
def test_files_are_compared_but_for_times(name: str, content: bytes, found: tuple[str, ...], tmp_path: Path) -> None:
    for folder, file, text in (("whole", "a.json", b'{"began": "2025-12-31", "cap": 20}'), ("broken", name, content)):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / file).write_bytes(text)
    assert differences(tmp_path / "whole", tmp_path / "broken") == found


@pytest.mark.parametrize(
    ("said", "named"),
    [
        ("caldrive: found no room on the disk for a.json, wanted some: make room, and type it again\n", True),
        ("caldrive: found 3, wanted 4: type --cars 4\n", False),
        ("found no room on the disk\nTraceback\n", False),
    ],
)
def test_a_full_disk_is_named_in_one_sentence(said: str, named: bool) -> None:
    assert named_as_full(said) == named


def test_what_a_verb_reads_is_made_before_it() -> None:
    assert [work.verb for work in needed_for(["train"])] == ["collect", "train"]
    assert [work.verb for work in needed_for(["report"])] == ["benchmark", "report"]
    assert [share(50, k, 4) for k in range(4)] == [12, 13, 12, 13]


def test_a_row_says_what_was_seen() -> None:
    assert row("train", Tally(3, 1, 2)).endswith("1 of them by a full disk, 2 times finished: the same files")
    assert row("train", Tally(3, 1, 2, ("a differs",))).endswith(": a differs")
