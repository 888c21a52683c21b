"""An attempt: a command line and the files that it meets, in a folder of its own from which it can be made again."""

from __future__ import annotations

import json
import shutil
from dataclasses import dataclass, field
from pathlib import Path

ABOUT, GIVEN = "attempt.json", "given"  # what is kept of an attempt: this file, and the folder of its files
WORK = Path("deep/down/work")  # where it runs: deep enough for ../.. to stay inside


@dataclass(frozen=True)
class Attempt:
    """kind: of what is attacked; arguments: of caldrive, where paths are from the folder with the files; bad: why this
    must not succeed, empty where nobody knows."""

    kind: str
    arguments: tuple[str, ...]
    files: dict[str, bytes] = field(default_factory=dict)
    bad: str = ""


def lay_out(attempt: Attempt, folder: Path) -> Path:
    """Writes an attempt's files where it is to run, and returns that place."""
    work = folder / WORK
    work.mkdir(parents=True)
    for name, content in attempt.files.items():
        path = work / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    return work


def keep(attempt: Attempt, folder: Path, verdict: dict[str, object]) -> None:
    """Writes an attempt down beside what became of it."""
    for name, content in attempt.files.items():
        path = folder / GIVEN / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    about = {"kind": attempt.kind, "arguments": attempt.arguments, "bad": attempt.bad, **verdict}
    (folder / ABOUT).write_text(json.dumps(about, indent=1) + "\n")


def kept(folder: Path) -> Attempt:
    """The inverse of `keep`."""
    about = json.loads((folder / ABOUT).read_text())
    given = folder / GIVEN
    return Attempt(about["kind"], tuple(about["arguments"]), tree(given) if given.is_dir() else {}, about["bad"])


def tree(folder: Path) -> dict[str, bytes]:
    """All files of a folder by their paths in it."""
    paths = sorted(path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in paths}


def fresh(folder: Path) -> Path:
    """The folder, empty."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    return folder
