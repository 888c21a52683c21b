"""The command line as a program sees it: one JSON answer on stdout, or one sentence on stderr; and somebody's agent."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO, Any

import pytest

from caldrive.cli import main


@contextmanager
def _stdout_of_a_process() -> Iterator[IO[str]]:
    """A file in the place of stdout, which also hears what a library's C code prints."""
    with TemporaryFile("w+") as file, open(1, "w", closefd=False) as stdout:
        kept = os.dup(1)
        os.dup2(file.fileno(), 1)
        try:
            with redirect_stdout(stdout):
                yield file
        finally:
            os.dup2(kept, 1)
            os.close(kept)


def run_json(*arguments: str, code: int = 0) -> dict[str, Any]:
    """What a command prints with --json, which must be all that it prints. code: with which it ends."""
    with _stdout_of_a_process() as file:
        assert main([*arguments, "--json"]) == code
        sys.stdout.flush()
        file.seek(0)
        answer: dict[str, Any] = json.load(file)
    return answer


def refusal(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """The sentence with which a command ends."""
    code = main(list(arguments))
    printed = capsys.readouterr()
    assert (code, printed.out, printed.err.count("\n")) == (2, "", 1)
    assert printed.err.startswith("caldrive: ")
    return printed.err


def write_agent(folder: Path, body: str, *, imports: str = "Affordances, CameraConfig, Control, Decision") -> str:
    """A file with a class Own; returns what to type behind --agent. body: of the class, without its indentation."""
    lines = "\n".join(f"    {line}" for line in body.splitlines())
    (folder / "own.py").write_text(f"import numpy as np\nfrom caldrive import {imports}\n\nclass Own:\n{lines}\n")
    return f"{folder / 'own.py'}:Own"
