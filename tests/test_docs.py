"""The pages: their code runs, their commands are understood, and what they name is there."""

from __future__ import annotations

import re
import runpy
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Picture

import caldrive
from caldrive.benchmark.suites import suite, to_json
from caldrive.cli import main, parse
from caldrive.commands import VERBS, verb_words
from caldrive.commands.answer import Configurable
from caldrive.perception.network.tensor_file import UNFINISHED
from caldrive.visualization import contact_sheet
from caldrive.visualization.episode_video import VideoWriter
from scripts.kept_reports import SUITES, report_again
from tests.documentation import (
    DOCS,
    PAGES,
    ROOT,
    SHORT_SUITE,
    Block,
    blocks,
    caldrive_lines,
    caldrive_spans,
    commands,
    shorten_suites,
    shortened,
)

CODE = ROOT / "src" / "caldrive"
COMMAND_LINE = DOCS / "command-line.md"
OWN = sorted(DOCS.glob("own/*.md"))
OF_A_TRAINING = {UNFINISHED, "model.safetensors", "state.safetensors"}
MOST_LINES = 25  # of the reader's own code


@pytest.fixture
def desk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with what a reader has: a video, three pictures; and, for the test, a short suite in place of quick."""
    monkeypatch.chdir(tmp_path)
    one_weather = partial(contact_sheet.contact_sheet, weathers=(1,))
    monkeypatch.setattr(contact_sheet, "contact_sheet", one_weather)
    image = np.tile(np.linspace(40, 200, 800, dtype=np.uint8)[None, :, None], (600, 1, 3))
    with VideoWriter(tmp_path / "my_video.mp4", rate=10) as video:
        for _ in range(3):
            video.add(image)
    for k in range(3):
        Picture.fromarray(image).save(tmp_path / f"picture{k}.png")
    (tmp_path / SHORT_SUITE).write_text(to_json(suite("quick")[:1]))
    return tmp_path


def run(block: Block, folder: Path) -> None:
    """Does what a reader does with a block: saves the file, types the commands, runs the Python."""
    if block.title:
        (folder / block.title).write_text(block.text)
    elif block.language == "python":
        exec(compile(block.text, "page", "exec"), {"__name__": "__page__"})
    elif block.language == "bash":
        for program, *arguments in commands(block.text):
            shorten_suites(folder)
            if program == "python":
                runpy.run_path(arguments[0], run_name="__main__")
            else:
                assert main(shortened(arguments)) == 0, arguments


@pytest.mark.parametrize("page", OWN, ids=lambda page: page.stem)
def test_what_a_page_on_bringing_your_own_shows_works(page: Path, desk: Path) -> None:
    for block in blocks(page):
        run(block, desk)


@pytest.mark.parametrize("page", OWN, ids=lambda page: page.stem)
def test_your_own_takes_25_lines_at_most(page: Path) -> None:
    lines = {block.title: len(block.text.splitlines()) for block in blocks(page) if block.title}
    assert all(n <= MOST_LINES for n in lines.values()), lines


@pytest.mark.parametrize("page", [ROOT / "README.md", DOCS / "quickstart.md"], ids=lambda page: page.stem)
def test_the_python_of_the_first_pages_runs(page: Path, desk: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for block in blocks(page):
        if block.language == "python":
            run(block, desk)
    assert "reached the goal in time" in capsys.readouterr().out


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_command_on_a_page_is_understood(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for block in blocks(page):
        if block.title:
            (tmp_path / block.title).write_text(block.text)
    for arguments in [*caldrive_lines(page), *caldrive_spans(page)]:
        parse(arguments)


def test_the_page_of_the_command_line_says_which_verbs_take_a_file() -> None:
    [sentence] = re.findall(
        r"`--config FILE.toml` takes options from a file, in (.*?)\.", COMMAND_LINE.read_text(), re.DOTALL
    )
    named = re.findall(r"`(.+?)`", sentence)
    assert named == sorted(name for name, verb in VERBS.items() if issubclass(verb.kind, Configurable))


def test_every_verb_is_shown() -> None:
    assert {verb_words(line) for line in caldrive_lines(COMMAND_LINE)} == set(VERBS)


def test_the_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text().splitlines()) <= 120


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_file_that_a_page_names_is_there(page: Path) -> None:
    written = {block.title for block in blocks(page)}
    named = re.findall(r"`((?!out/)(?:[\w.-]+/)*[\w-]+\.(?:py|cff|toml|txt|safetensors))`", page.read_text())
    names = set(named) - written - OF_A_TRAINING
    places = (ROOT, CODE, DOCS)
    assert [name for name in names if not any((place / name).is_file() for place in places)] == []


def test_every_link_of_the_readme_leads_somewhere() -> None:
    links = re.findall(r"\]\(([^)#]+)\)", (ROOT / "README.md").read_text())
    assert [link for link in links if not (ROOT / link).is_file()] == []


@pytest.mark.parametrize("suite_name", SUITES)
def test_the_kept_lines_give_the_kept_report(suite_name: str) -> None:
    folder = DOCS / "results" / suite_name
    assert report_again(folder) == (folder / "report.md").read_text(), "type python -m scripts.kept_reports"


def test_the_map_names_every_folder_of_the_package() -> None:
    text = (DOCS / "files.md").read_text()
    folders = {path.parent.relative_to(CODE).as_posix() for path in CODE.rglob("*.py")}
    assert {folder for folder in folders if f"<!-- files: {folder} -->" not in text} == set()
    assert {folder for folder in folders - {"."} if f"| `{folder}/` |" not in text} == set()


def test_the_api_page_has_every_public_name() -> None:
    text = (DOCS / "api.md").read_text()
    named = {place.rpartition(".")[2] for place in re.findall(r"^::: (\S+)$", text, re.MULTILINE)}
    assert set(caldrive.__dict__["__all__"]) - {"__version__"} <= named
