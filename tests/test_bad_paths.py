"""A file or folder that cannot be read or written ends in one sentence that names it, whichever verb was given it."""

from __future__ import annotations

import errno
from collections.abc import Callable
from itertools import product
from pathlib import Path

import pytest

from caldrive.cli import main

DRIVE = ("drive", "--seconds", "0.2", "--no-video", "--out", "out")
PLACES = ("--from", "0,0", "--to", "9,0")
BENCHMARK = ("benchmark", "--agent", "oracle")
TUNE = ("tune", "--port", "1")  # a port that cannot be: what is not refused before it is not served
INPUTS: dict[str, tuple[str, ...]] = {  # {} stands for the path
    "drive, model": (*DRIVE, "--model", "{}.safetensors"),
    "drive, controller": (*DRIVE, "--agent", "oracle", "--controller", "{}.toml"),
    "drive, agent": (*DRIVE, "--agent", "{}.py:Own"),
    "drive, world": (*DRIVE, *PLACES, "--agent", "oracle", "--world", "{}.py:Own"),
    "drive, town": (*DRIVE, "--agent", "oracle", "--town", "{}.xodr"),
    "drive, config": (*DRIVE, "--config", "{}.toml"),
    "benchmark, suite": (*BENCHMARK, "--out", "out", "--suite", "{}.json"),
    "benchmark, known": (*BENCHMARK, "--out", "out", "--known", "{}"),
    "replay": ("replay", "{}", "town01-w01-navigation-00"),
    "report": ("report", "{}"),
    "collect, town": ("collect", "--out", "out", "--town", "{}.xodr"),
    "train, config": ("train", "--out", "out", "--config", "{}.toml"),
    "tune, controller": (*TUNE, "--controller", "{}.toml"),
    "tune, config": (*TUNE, "--config", "{}.toml"),
    "see, picture": ("see", "{}.png", "--out", "out.mp4"),
    "see, video": ("see", "{}.mp4", "--out", "out.mp4"),
    "town, town": ("town", "--plan", "out.png", "--town", "{}.xodr"),
    "speed world": ("speed", "world", "--steps", "1", "--town", "{}.xodr"),
    "speed agent": ("speed", "agent", "--steps", "1", "--model", "{}.safetensors"),
}
OUTPUTS: dict[str, tuple[str, ...]] = {
    "drive": ("drive", "--agent", "oracle", "--seconds", "0.2", "--out", "{}"),
    "drive, record": (*DRIVE, "--agent", "oracle", "--record", "{}.mcap"),
    "benchmark": (*BENCHMARK, "--out", "{}"),
    "replay": ("replay", "run", "x", "--out", "{}.mp4"),
    "collect": ("collect", "--out", "{}"),
    "data": ("data", "run", "--picture", "{}.png"),
    "convert": ("convert", "run", "--out", "{}"),
    "train": ("train", "--out", "{}"),
    "evaluate": ("evaluate", "--worst", "{}.png"),
    "see": ("see", "run", "--out", "{}.mp4"),
    "see, values": ("see", "run", "--out", "out.mp4", "--values", "{}.csv"),
    "tune": (*TUNE, "--out", "{}"),
    "tune, search": ("tune", "--auto", "--out", "{}"),
    "town, sheet": ("town", "--sheet", "{}.png"),
    "town, plan": ("town", "--plan", "{}.png"),
}


def loop(path: Path) -> None:
    path.symlink_to(path.name)


def binary(path: Path) -> None:
    path.write_bytes(b"\xff\xfe\x00\x80" * 50)


def nested(path: Path) -> None:
    start = {".toml": b"a = " + b"[" * 3000, ".xodr": b"<a>" * 3000}
    path.write_bytes(start.get(path.suffix, b"[" * 3000))


SPOILT: dict[str, Callable[[Path], object]] = {
    "folder": Path.mkdir, "loop": loop, "binary": binary, "nested": nested, "empty": Path.touch,
}  # fmt: skip
ALIKE = (  # an empty file of settings changes nothing; for a picture the network is loaded first
    ("drive, config", "empty"), ("train, config", "empty"), ("drive, controller", "empty"),
    ("tune, config", "empty"), ("tune, controller", "empty"),
    ("see, picture", "nested"), ("see, picture", "empty"),
)  # fmt: skip
NAMES = {"null byte": "a\0b", "too long": "l" * 300, "in a file": "file/a", "nothing": "gone/a"}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("CALDRIVE_TRACEBACK", raising=False)
    (tmp_path / "file").touch()
    return tmp_path


def refusal(capsys: pytest.CaptureFixture[str], words: tuple[str, ...], name: str) -> str:
    """The one sentence that a command says."""
    code = main([word.replace("{}", name) for word in words])
    printed = capsys.readouterr()
    assert (code, printed.out) == (2, "")
    assert printed.err.startswith("caldrive: ")
    assert printed.err.count("\n") == 1
    assert "fault of the program" not in printed.err
    return printed.err


@pytest.mark.parametrize(("words", "name"), list(product(INPUTS, NAMES)))
def test_a_name_that_leads_nowhere_is_named(
    words: str, name: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shown = NAMES[name].replace("\0", "\\x00")
    assert shown in refusal(capsys, INPUTS[words], NAMES[name])
    assert [path.name for path in folder.iterdir()] == ["file"]


@pytest.mark.parametrize(("words", "kind"), [pair for pair in product(INPUTS, SPOILT) if pair not in ALIKE])
def test_a_file_that_cannot_be_read_is_named(
    words: str, kind: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    word = next(word for word in INPUTS[words] if "{}" in word).removesuffix(":Own")
    SPOILT[kind](folder / word.replace("{}", "spoilt"))
    assert "spoilt" in refusal(capsys, INPUTS[words], "spoilt")


@pytest.mark.parametrize(("words", "name"), list(product(OUTPUTS, ("null byte", "too long", "in a file"))))
def test_a_place_that_cannot_be_written_to_is_named(
    words: str, name: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    said = refusal(capsys, OUTPUTS[words], NAMES[name])
    assert NAMES[name].replace("\0", "\\x00") in said or "file is a file" in said
    assert [path.name for path in folder.iterdir()] == ["file"]


@pytest.mark.parametrize(
    ("error", "expected"),
    [
        (OSError(errno.EACCES, "Permission denied", "kept.json"), "kept.json is no use (permission denied)"),
        (OSError(errno.ELOOP, "Too many levels of symbolic links"), "a file or folder is no use (too many levels"),
        (OSError(errno.ENOSPC, "No space left on device"), "no room on the disk"),
        (MemoryError(), "too little memory"),
        (
            ImportError("libXext.so.6: cannot open shared object file: No such file", name="libsumo._libsumo"),
            "found no libXext.so.6 on this machine, wanted it for libsumo._libsumo: on Debian type apt-get install",
        ),
        (
            ImportError("libtbb.so.12: cannot open shared object file: No such file", name="openvino"),
            "found no libtbb.so.12 on this machine, wanted it for openvino: install it",
        ),
        (ZeroDivisionError("division by zero"), "a fault of the program (ZeroDivisionError: division by zero)"),
        (RecursionError("maximum recursion depth exceeded"), "a fault of the program (RecursionError"),
        (
            UnicodeDecodeError("utf-8", b"\xff", 0, 1, "invalid start byte"),
            "a fault of the program (UnicodeDecodeError",
        ),
    ],
    ids=lambda value: type(value).__name__,
)
def test_every_kind_of_error_ends_in_one_sentence(
    error: Exception, expected: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(*_: object) -> None:
        raise error

    monkeypatch.delenv("CALDRIVE_TRACEBACK", raising=False)
    monkeypatch.setattr("caldrive.driving.drive.drive", fail)
    assert main(["drive"]) == 2
    said = capsys.readouterr().err
    assert said.startswith("caldrive: found ")
    assert said.count("\n") == 1
    assert expected in said


@pytest.mark.parametrize("text", ['out = "a\\u0000b"', 'known = ["a\\u0000b"]', 'suite = "a\\u0000b"'])
def test_a_null_byte_in_a_file_of_settings_is_named(
    text: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "own.toml").write_text(text)
    assert "own.toml" in refusal(capsys, ("benchmark", "--config", "own.toml"), "")
