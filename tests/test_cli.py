"""The command line itself: its help, what it says of words that it does not understand, and narrow terminals."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest

from caldrive.cli import main
from caldrive.commands import VERBS
from caldrive.progress import readable_width
from tests.command_line import refusal


def helped(verb: str, capsys: pytest.CaptureFixture[str]) -> str:
    with pytest.raises(SystemExit) as ended:
        main([*verb.split(), "--help"])
    assert ended.value.code == 0
    return capsys.readouterr().out


@pytest.mark.parametrize("columns", ["1", "0", "-1", "junk", "²", "", "9" * 30, "9" * 5000])
def test_any_width_of_a_terminal_becomes_one_in_which_text_can_be_set(
    columns: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", columns)
    monkeypatch.setenv("LINES", columns)
    with readable_width():
        assert 40 <= int(os.environ["COLUMNS"]) <= 1000
        assert int(os.environ["LINES"]) > 0
    assert (os.environ["COLUMNS"], os.environ["LINES"]) == (columns, columns)


@pytest.mark.parametrize("columns", ["1", "junk"])
def test_help_ends_in_any_terminal(
    columns: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", columns)
    assert "--no-video" in helped("drive", capsys)


@pytest.mark.parametrize("verb", VERBS)
def test_a_mistake_recommends_the_verbs_own_help(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    for words in (["--wings", "2"], ["--wings"]):
        assert main([*verb.split(), *words]) == 2
        assert capsys.readouterr().err.endswith(f": type caldrive {verb} --help\n")


@pytest.mark.parametrize("words", [["speed"], ["speed", "fly"], ["speed", "--wings"]])
def test_a_mistake_within_a_group_recommends_the_groups_help(
    words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(words) == 2
    assert capsys.readouterr().err.endswith(": type caldrive speed --help\n")


@pytest.mark.parametrize("verb", VERBS)
def test_only_a_drive_without_video_is_asked_for_by_no(
    verb: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    shown = helped(verb, capsys)
    assert set(re.findall(r"--[\w.-]*\bno-[\w-]+", shown)) == ({"--no-video"} if verb == "drive" else set())


def test_a_drive_without_video_says_what_is_written_instead(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    shown = " ".join(helped("drive", capsys).replace("│", " ").split())
    assert "--no-video writes each episode's trace (episode-000.json) alone" in shown


def test_settings_are_asked_for_only_of_verbs_that_take_them(capsys: pytest.CaptureFixture[str]) -> None:
    for words in (["report", "--config", "a.toml"], ["see", "a.png", "--config", "a.toml"]):
        assert main(words) == 2
        assert "--config" in capsys.readouterr().err
    assert main(["drive", "--config", ""]) == 2
    assert "found no file . that can be read" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "shown"), [("\x1b[31mred", r"\x1b[31mred"), ("\udcff", r"\udcff")], ids=["a colour", "a byte"]
)
def test_letters_that_nobody_can_print_are_spelt_out(name: str, shown: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert f"{shown}.toml" in refusal(capsys, "drive", "--config", f"{name}.toml")


def test_a_word_without_end_is_cut_off(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "drive.toml").write_text(f'controller = "{5000 * "x"}"')
    said = refusal(capsys, "drive", "--config", str(tmp_path / "drive.toml"), "--agent", "oracle")
    assert "xxx..." in said
    assert len(said) < 1500


def test_of_an_option_that_is_there_twice_the_last_counts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "drive.toml").write_text("cap = 20.0")
    said = refusal(capsys, "drive", "--config", str(tmp_path / "drive.toml"), "--config", "gone.toml")
    assert "found no file gone.toml" in said
