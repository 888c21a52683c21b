"""The pages as data: their blocks of code, and what makes the commands in them quick enough for a test."""

from __future__ import annotations

import json
import re
import shlex
import textwrap
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = sorted([*ROOT.glob("*.md"), *DOCS.glob("*.md"), *DOCS.glob("own/*.md")])
FENCE = re.compile(r"^( *)```(\w+)(?: title=\"(.+?)\")?\n(.*?)^\1```$", re.MULTILINE | re.DOTALL)
SECONDS = 0.3  # of a drive that a page shows
SHORT_SUITE = "short.json"


@dataclass(frozen=True)
class Block:
    """A fenced block of a page. title: the file that it is, empty where it is none."""

    language: str
    title: str
    text: str


def blocks(page: Path) -> list[Block]:
    """The fenced blocks of a page, in order."""
    return [
        Block(language, title, textwrap.dedent(text)) for _, language, title, text in FENCE.findall(page.read_text())
    ]


def commands(text: str) -> list[list[str]]:
    """The words of each command line of a block, without comments."""
    return [words for line in text.splitlines() if (words := shlex.split(line, comments=True))]


def caldrive_lines(page: Path) -> list[list[str]]:
    """The words behind `caldrive` of each command that a page shows in a block."""
    indented = re.findall(r"^ {4}(caldrive .*)$", page.read_text(), re.MULTILINE)
    shown = [command for block in blocks(page) if block.language == "bash" for command in commands(block.text)]
    return [command[1:] for command in [*shown, *map(shlex.split, _uncommented(indented))] if command[0] == "caldrive"]


def caldrive_spans(page: Path) -> list[list[str]]:
    """The words behind `caldrive` of each whole command within a sentence; a verb alone is no command."""
    spans = re.findall(r"(?<!`)`caldrive ([^`]+)`", page.read_text())
    found = [span.split() for span in spans if "..." not in span]
    return [words for words in found if len(words) > 1 and words[-1] != "--help" and words[0] != "speed"]


def _uncommented(lines: list[str]) -> list[str]:
    return [line.partition(" #")[0] for line in lines]


def shortened(arguments: list[str]) -> list[str]:
    """The same command with a second of driving instead of a whole episode, a short suite for a long one, and two
    short episodes for many."""
    verb, *rest = arguments
    if verb == "drive":
        if "--seconds" in rest:
            del rest[rest.index("--seconds") : rest.index("--seconds") + 2]
        return [verb, *rest, "--seconds", str(SECONDS)]
    if verb == "collect":  # enough for a file that trains and one that validates
        del rest[rest.index("--episodes") : rest.index("--episodes") + 2]
        return [verb, *rest, "--episodes", "2", "--duration", "6.8", "--cars", "5", "--people", "5", "--workers", "1"]
    if verb == "benchmark":
        return [verb, *(SHORT_SUITE if word == "quick" else word for word in rest), "--workers", "1"]
    return arguments


def shorten_suites(folder: Path) -> None:
    """Gives every trial of the suites in a folder a second."""
    for path in folder.glob("*.json"):
        rows = json.loads(path.read_text())
        for row in rows:
            row["scenario"]["time_limit"] = SECONDS
        path.write_text(json.dumps(rows))
