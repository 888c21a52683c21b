"""A folder belongs to the process that writes to it."""

from __future__ import annotations

from pathlib import Path

import pytest

from caldrive.benchmark.report import page, runs
from caldrive.cli import main
from caldrive.files import locked_folder

TAKEN = "found another process at work in"


@pytest.mark.parametrize(
    "words",
    [
        ("drive", "--agent", "oracle", "--town", "town02", "--task", "straight", "--seconds", "0.2", "--no-video"),
        ("collect", "--episodes", "1", "--duration", "0.2", "--workers", "1"),
        ("benchmark", "--suite", "quick", "--agent", "oracle", "--workers", "1"),
    ],
    ids=lambda words: words[0],
)
def test_a_folder_where_another_process_is_at_work_is_left_alone(
    words: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with locked_folder(tmp_path):
        assert main([*words, "--out", str(tmp_path)]) == 2
    assert TAKEN in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_two_reports_do_not_mix(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = runs.BenchmarkRun("one", tmp_path, {}, ())
    monkeypatch.setattr(runs, "load_runs", lambda folders: [run])
    monkeypatch.setattr(runs, "failures", lambda of: [])
    monkeypatch.setattr(page, "report_text", lambda of: "text")
    monkeypatch.setattr(page, "report_page", lambda of: "page")
    out = tmp_path / "report"
    with locked_folder(out):
        assert main(["report", str(tmp_path), "--out", str(out)]) == 2
    assert list(out.iterdir()) == []
    assert main(["report", str(tmp_path), "--out", str(out)]) == 0
