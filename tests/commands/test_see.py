"""`caldrive see`, end to end: pictures in, a video and a table out, or one sentence."""

from __future__ import annotations

import csv
from pathlib import Path

import av
import numpy as np
import pyarrow.parquet as pq
import pytest
from PIL import Image as Picture

from caldrive.affordances import SPECS
from caldrive.cli import main
from caldrive.visualization.episode_video import VideoWriter
from tests.command_line import run_json


def n_frames(path: str) -> tuple[int, float]:
    with av.open(path) as film:
        return sum(1 for _ in film.decode(video=0)), float(film.streams.video[0].average_rate or 0)


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three pictures, of which the second is black."""
    folder = tmp_path_factory.mktemp("pictures")
    for number, level in enumerate((90, 0, 120)):
        image = np.full((90, 200, 3), level, np.uint8)
        image[:, :100] //= 2
        Picture.fromarray(image).save(folder / f"{number}.png")
    return folder


def test_a_folder_becomes_a_video_and_a_table_with_a_row_for_each_picture(pictures: Path, tmp_path: Path) -> None:
    answer = run_json("see", str(pictures), "--out", str(tmp_path / "seen" / "film.mp4"))
    assert n_frames(answer["video"]) == (3, 10.0)
    assert answer["values"] == str(tmp_path / "seen" / "film.csv")
    with Path(answer["values"]).open() as file:
        rows = list(csv.DictReader(file))
    assert [row["file"] for row in rows] == ["0.png", "1.png", "2.png"]
    assert [row["note"] for row in rows] == ["", "the image is black", ""]
    assert all(0 <= float(rows[0][spec.name]) <= 50 or spec.low < 0 for spec in SPECS)
    assert {rows[1][spec.name] for spec in SPECS} == {""}
    assert (answer["pictures"], answer["no_use"]) == (3, 1)
    assert sorted(path.name for path in (tmp_path / "seen").iterdir()) == ["film.csv", "film.mp4"]


def test_it_says_that_the_network_knows_only_the_embedded_towns(
    pictures: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["see", str(pictures), "--out", str(tmp_path / "film.mp4")]) == 0
    assert "knows only caldrive's embedded towns" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        main(["see", "--help"])
    assert "only the embedded towns" in " ".join(capsys.readouterr().out.split())


def test_a_fast_video_is_named_and_can_be_thinned_and_its_values_go_to_parquet(tmp_path: Path) -> None:
    with VideoWriter(tmp_path / "own.mp4", rate=30.0) as video:
        for level in range(40, 100, 10):
            video.add(np.full((96, 200, 3), level, np.uint8))
    out, values = str(tmp_path / "film.mp4"), str(tmp_path / "values.parquet")
    every = run_json("see", str(tmp_path / "own.mp4"), "--out", out, "--crop", "4:92")
    assert n_frames(out) == (6, 30.0)
    assert "type --every 3" in every["notes"][-1]
    third = run_json(
        "see", str(tmp_path / "own.mp4"), "--out", out, "--values", values, "--every", "3", "--command", "left"
    )
    assert n_frames(out) == (2, 10.0)
    assert len(third["notes"]) == 1
    table = pq.read_table(values).to_pydict()
    assert (table["picture"], table["time"]) == ([0, 3], pytest.approx([0.0, 0.1]))
    assert all(isinstance(value, int) for value in table["speed_sign"])


def mistakes(folder: Path) -> dict[str, tuple[list[str], str]]:
    source = str(folder / "pictures")
    return {
        "nothing there": ([str(folder / "gone.mp4")], "check the path"),
        "an empty folder": ([str(folder / "empty")], "wanted files that end in .png"),
        "no video": ([str(folder / "text.mp4")], "cannot be read as a video"),
        "a crop outside": ([source, "--crop", "50:91"], "type --crop 18:72"),
        "no crop": ([source, "--crop", "many"], "type --crop 120:480"),
        "a video of another kind": ([source, "--out", str(folder / "film.avi")], "ends in .mp4"),
        "values of another kind": ([source, "--values", str(folder / "values.txt")], "ends in .csv or .parquet"),
        "none of them": ([source, "--every", "0"], "type --every 1"),
        "an unknown command": ([source, "--command", "back"], "wanted one of left, straight, right"),
        "no such model": ([source, "--model", str(folder / "gone.safetensors")], "gone.safetensors"),
        "itself": ([str(folder / "own.mp4"), "--out", str(folder / "own.mp4")], "wanted another name"),
    }


@pytest.mark.parametrize("mistake", mistakes(Path()))
def test_a_mistake_ends_in_one_sentence_and_leaves_nothing(
    mistake: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    (tmp_path / "pictures").mkdir()
    (tmp_path / "text.mp4").write_text("no video")
    with VideoWriter(tmp_path / "own.mp4") as video:
        video.add(np.full((96, 200, 3), 90, np.uint8))
    for name in ("0.png", "1.png"):
        Picture.new("RGB", (200, 90), (90, 90, 90)).save(tmp_path / "pictures" / name)
    before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")}
    arguments, expected = mistakes(tmp_path)[mistake]
    assert main(["see", *arguments]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("caldrive: ")
    assert printed.err.count("\n") == 1
    assert expected in printed.err
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")} == before


def test_a_table_that_cannot_be_written_leaves_no_video(
    pictures: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device", "values.csv")

    monkeypatch.setattr("caldrive.driving.see.write_whole", fail)
    assert main(["see", str(pictures), "--out", str(tmp_path / "film.mp4")]) == 2
    assert list(tmp_path.iterdir()) == []
