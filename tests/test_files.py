"""Files appear whole or not at all, and what a killed process left half-written does not stay."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from caldrive.files import locked_folder, temporary_path, write_whole

KILLED = """
import os, sys
from pathlib import Path
from caldrive.files import write_whole
os.replace = lambda *_: os.kill(os.getpid(), 9)
write_whole(Path(sys.argv[1]), b"new")
"""


def test_what_a_killed_process_left_half_written_is_removed_by_the_next(tmp_path: Path) -> None:
    file = tmp_path / "a[1].json"
    file.write_bytes(b"old")
    assert subprocess.run([sys.executable, "-c", KILLED, str(file)], check=False).returncode == -9
    assert len(list(tmp_path.iterdir())) == 2
    assert file.read_bytes() == b"old"
    write_whole(file, b"newer")
    assert [path.name for path in tmp_path.iterdir()] == ["a[1].json"]
    assert file.read_bytes() == b"newer"


def test_what_others_write_at_this_moment_is_left_alone(tmp_path: Path) -> None:
    kept = [tmp_path / f".a.json.{end}.tmp" for end in (os.getpid(), os.getppid(), "own")]
    kept.append(tmp_path / ".b.json.999999999.tmp")
    for path in kept:
        path.touch()
    assert temporary_path(tmp_path / "a.json") == kept[0]
    assert sorted(tmp_path.iterdir()) == sorted(kept)


@pytest.mark.parametrize(("written", "left"), [([], []), (["file"], ["out", "out/run", "out/run/file"])])
def test_a_folder_that_was_made_for_a_work_that_failed_goes_again(
    tmp_path: Path, written: list[str], left: list[str]
) -> None:
    folder = tmp_path / "out" / "run"

    def fail() -> None:
        with locked_folder(folder):
            for name in written:
                (folder / name).touch()
            raise ValueError("no use")

    with pytest.raises(ValueError, match="no use"):
        fail()
    assert sorted(path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*")) == left
