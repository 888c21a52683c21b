"""What a person can do wrong ends in one sentence on stderr and exit code 2, and leaves nothing behind."""

from __future__ import annotations

from pathlib import Path

import pytest

from caldrive.cli import main
from caldrive.files import write_whole
from tests.command_line import run_json

DRIVE = ["drive", "--agent", "oracle", "--seconds", "1"]
MISTAKES = {
    "unknown verb": (["fly"], "fly"),
    "no verb": ([], "wanted one of drive, benchmark"),
    "unknown option": ([*DRIVE, "--wings", "2"], "--wings"),
    "no number": ([*DRIVE, "--cars", "many"], "--cars"),
    "unknown town": ([*DRIVE, "--town", "mars"], "random:SEED or an OpenDRIVE file"),
    "no such map": ([*DRIVE, "--town", "{tmp}/gone.xodr"], "check the path given to --town"),
    "broken map": ([*DRIVE, "--town", "{tmp}/broken.xodr"], "give another .xodr file"),
    "empty map": ([*DRIVE, "--town", "{tmp}/empty.xodr"], "give another .xodr file"),
    "unknown weather": ([*DRIVE, "--weather", "15"], "wanted 1 to 14"),
    "unknown task": ([*DRIVE, "--task", "swim"], "wanted one of straight"),
    "unknown agent": ([*DRIVE, "--agent", "bob"], "wanted one of cal, oracle"),
    "unknown controller": ([*DRIVE, "--controller", "wild"], "wanted one of default, paper"),
    "too many cars": ([*DRIVE, "--cars", "9999"], "ask for fewer with --cars"),
    "too many people": ([*DRIVE, "--people", "99999"], "ask for fewer with --people"),
    "less than no car": ([*DRIVE, "--cars", "-1"], "type --cars 0"),
    "no episode": ([*DRIVE, "--episodes", "0"], "type --episodes 1"),
    "no such route": ([*DRIVE, "--route", "25"], "wanted 0 to 24"),
    "negative seed": ([*DRIVE, "--seed", "-1"], "type --seed 0"),
    "no time": ([*DRIVE, "--seconds", "nan"], "type --seconds 60"),
    "a cap of nothing": ([*DRIVE, "--cap", "0"], "type --cap 20"),
    "a file for a folder": ([*DRIVE, "--out", "{tmp}/broken.xodr/results"], "give another --out"),
    "no such model": (["drive", "--model", "{tmp}/gone.safetensors"], "gone.safetensors"),
    "corrupt model": (["drive", "--model", "{tmp}/corrupt.safetensors"], "corrupt.safetensors is damaged"),
    "corrupt model, timed": (["speed", "agent", "--model", "{tmp}/corrupt.safetensors"], "is damaged"),
    "no step to time": (["speed", "world", "--steps", "0"], "type --steps 600"),
    "unknown town, timed": (["speed", "world", "--town", "mars"], "--town town01"),
    "sheet of no kind": (["town", "--sheet", "{tmp}/town.jpg"], "wanted a name that ends in .png"),
    "sheet of no size": (["town", "--sheet", "{tmp}/town.png", "--width", "0"], "wanted 16 to 16384"),
    "sheet of too many looks": (["town", "--sheet", "{tmp}/town.png", "--randomised", "-1"], "wanted 0 to 100"),
    "a damaged episode, to learn from": (["train", "--data", "{tmp}/damaged", "--out", "{tmp}"], "record again"),
    "a damaged episode, to evaluate": (["evaluate", "--data", "{tmp}/damaged"], "record again"),
    "no episode to learn from": (["train", "--data", "{tmp}/folder.png", "--out", "{tmp}"], "caldrive collect"),
    "no step to learn": (["train", "--steps", "0", "--out", "{tmp}"], "type --steps 14000"),
    "a rate of nothing": (["train", "--rate", "0", "--out", "{tmp}"], "type --learning-rate 0.001"),
    "a cap below nothing, in a suite": (["benchmark", "--cap", "-5", "--out", "{tmp}"], "type --cap 20"),
    "a cap that is no number, in a suite": (["benchmark", "--cap", "nan", "--out", "{tmp}"], "type --cap 20"),
    "a cap without end, in a suite": (["benchmark", "--cap", "inf", "--out", "{tmp}"], "type --cap 20"),
    "an unknown agent, in a suite": (
        ["benchmark", "--agent", "bob", "--out", "{tmp}/new"],
        "wanted one of cal, oracle",
    ),
    "no such time limit, in a suite": (
        ["benchmark", "--time-limit", "long", "--out", "{tmp}/new"],
        "type --time-limit paper",
    ),
    "a negative seed, in a suite": (["benchmark", "--seed", "-1", "--out", "{tmp}/new"], "type --seed 0"),
    "no such model, in a suite": (["benchmark", "--model", "{tmp}/gone.safetensors", "--out", "{tmp}/new"], "gone"),
    "no known benchmark": (["benchmark", "--known", "{tmp}", "--out", "{tmp}/new"], "found no run.json in"),
    "a seed too large": (["benchmark", "--seed", "9999999999", "--out", "{tmp}/new"], "type --seed 0"),
    "a negative seed, to learn from": (["train", "--seed", "-1", "--out", "{tmp}"], "type --seed 0"),
    "less than no car, timed": (["speed", "world", "--cars", "-1"], "type --cars 20"),
    "steps without end": (["speed", "world", "--steps", "1000000000000"], "type --steps 600"),
    "a drive without end": (["collect", "--duration", "inf", "--out", "{tmp}/new"], "type --duration 12.0"),
    "an image without end": (["collect", "--width", "100000", "--out", "{tmp}/new"], "type --width 200"),
    "a video over results": (["replay", "{tmp}", "a", "--out", "{tmp}/results.jsonl"], "ends in .mp4"),
    "a picture over a recording": (["data", "{tmp}", "--picture", "{tmp}/a.parquet"], "ends in .png"),
    "sheet in a folder's place": (["town", "--sheet", "{tmp}/folder.png"], "is a folder"),
}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with spoilt files, where nothing else may appear."""
    (tmp_path / "broken.xodr").write_text("<OpenDRIVE><road")
    (tmp_path / "empty.xodr").touch()
    (tmp_path / "damaged").mkdir()
    (tmp_path / "damaged" / "episode-00000.parquet").write_bytes(b"PAR1")
    (tmp_path / "corrupt.safetensors").write_bytes(b"\x08\x00\x00\x00\x00\x00\x00\x00{broken}")
    (tmp_path / "folder.png").mkdir()
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("CALDRIVE_TRACEBACK", raising=False)
    return tmp_path


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_ends_in_one_sentence(mistake: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments, expected = MISTAKES[mistake]
    before = sorted(folder.rglob("*"))
    code = main([one.replace("{tmp}", str(folder)) for one in arguments])
    said = capsys.readouterr()
    assert (code, said.out) == (2, "")
    assert said.err.startswith("caldrive: ")
    assert said.err.count("\n") == 1
    assert expected in said.err
    assert sorted(folder.rglob("*")) == before


@pytest.mark.parametrize("mistake", ["unknown verb", "unknown option", "broken map"])
def test_with_json_the_same_sentence_is_all_of_stdout(
    mistake: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments, expected = MISTAKES[mistake]
    answer = run_json(*(one.replace("{tmp}", str(folder)) for one in arguments), code=2)
    assert [f"caldrive: {sentence}\n" for sentence in answer.values()] == [capsys.readouterr().err]
    assert expected in answer["error"]


def test_a_gpu_that_is_not_there_is_named(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("torch.cuda.is_available", lambda: False)
    assert main(["train", "--data", str(folder), "--out", str(folder), "--device", "cuda"]) == 2
    assert "type --device cpu" in capsys.readouterr().err


def test_damaged_files_are_named_one_by_one(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["data", str(folder / "damaged"), "--picture", str(folder / "labels.png")]) == 1
    assert "episode-00000.parquet is damaged" in capsys.readouterr().out.replace("\n", " ")


def test_cal_without_a_model_says_what_else_to_type(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("caldrive.agents.rows.MODELS", folder / "gone")
    assert main(["drive"]) == 2
    said = capsys.readouterr().err
    assert "--agent oracle" in said
    assert "caldrive train" in said


def test_a_full_disk_is_named_in_words(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device", "out/drive.mp4")

    monkeypatch.setattr("caldrive.driving.drive.drive", fail)
    assert main(DRIVE) == 2
    assert capsys.readouterr().err == (
        "caldrive: found no room on the disk for out/drive.mp4, wanted some: make room, and type it again\n"
    )


def test_a_file_that_finds_no_room_is_named_and_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("caldrive.files.os.fsync", fail)
    with pytest.raises(OSError, match=r"No space left on device: '.*labels\.png'"):
        write_whole(tmp_path / "labels.png", b"content")
    assert list(tmp_path.iterdir()) == []


def test_ctrl_c_ends_in_one_line(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("caldrive.driving.drive.drive", interrupt)
    assert main(DRIVE) == 130
    assert capsys.readouterr().err == "caldrive: stopped by Ctrl-C\n"
