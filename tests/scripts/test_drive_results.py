"""Results that were driven on another machine go on from the lines that are kept."""

import gzip
import json
from pathlib import Path

import pytest

from caldrive.provenance import code_version
from scripts import drive_results


@pytest.fixture
def kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A kept run of unseen by the oracle, and empty out/results."""
    monkeypatch.setattr(drive_results, "KEPT", tmp_path / "kept")
    monkeypatch.setattr(drive_results, "OUT", tmp_path / "out")
    folder = tmp_path / "kept/unseen/oracle"
    folder.mkdir(parents=True)
    (folder / "run.json").write_text(json.dumps({"code": code_version()}))
    (folder / "results.jsonl.gz").write_bytes(gzip.compress(b"kept\n"))
    return folder


def test_kept_lines_are_taken_up_where_nothing_is(kept: Path, tmp_path: Path) -> None:
    drive_results.take_up("unseen", "oracle")
    assert (tmp_path / "out/unseen/oracle/results.jsonl").read_bytes() == b"kept\n"
    assert json.loads((tmp_path / "out/unseen/oracle/run.json").read_text()) == {"code": code_version()}


def test_a_folder_that_is_there_stays(kept: Path, tmp_path: Path) -> None:
    lines = tmp_path / "out/unseen/oracle/results.jsonl"
    lines.parent.mkdir(parents=True)
    lines.write_bytes(b"newer\n")
    drive_results.take_up("unseen", "oracle")
    assert lines.read_bytes() == b"newer\n"


def test_lines_of_other_code_are_not_taken_up(kept: Path, tmp_path: Path) -> None:
    (kept / "run.json").write_text(json.dumps({"code": "behaviour-0"}))
    drive_results.take_up("unseen", "oracle")
    assert not (tmp_path / "out").exists()
