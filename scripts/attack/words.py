"""Bad values for every option that a verb's --help names, so that a new option is attacked from its first day."""

from __future__ import annotations

import contextlib
import io
import math
import os
import random
import re
import shlex
from dataclasses import dataclass
from functools import lru_cache

from scripts.attack.attempt import Attempt
from scripts.attack.good import needed
from scripts.attack.mutations import NUMBERS, TEXTS
from scripts.attack.uses import BENCHMARK, COLLECT, DRIVE, TRAIN, Use

KIND = "command line"
MODEL = "--model training/model.safetensors"
BASES = tuple(
    Use(KIND, line, needs, "")
    for line, needs in (
        (DRIVE, ()),
        (f"drive --seconds 0.3 --no-video {MODEL}", ("training",)),
        (f"{DRIVE} --from 268,40 --to 179,332", ()),
        (f"{BENCHMARK} --suite suite.json --out out", ("suite.json",)),
        ("replay run short-1", ("run", "suite.json")),
        ("report run", ("run", "suite.json")),
        (COLLECT.replace("--out recording", "--out out"), ("recording.toml",)),
        ("data recording", ("recording",)),
        (TRAIN.replace("--out training", "--out out"), ("recording", "training.toml")),
        (f"evaluate --data recording {MODEL}", ("recording", "training")),
        (f"see pictures {MODEL}", ("pictures", "training")),
        ("town --town map.xodr --plan plan.png", ("map.xodr",)),
        ("speed world --steps 3 --cars 2 --people 2", ()),
        (f"speed agent --steps 3 --threads 1 {MODEL}", ("training",)),
    )
)
ODD = ("\udcff", "/dev/null", "/dev/zero", "/proc/self/mem", "recording", "suite.json", "1.5", " ", "-", "--", "3 4")
NAMES = {"--agent", "--controller", "--town", "--world", "--task", "--preset", "--precision", "--time-limit", "--from",
         "--to", "--crop", "--model", "--data", "--config"}  # nothing that is drawn here is one of these  # fmt: skip
HEAVY = {"--ray", "--known", "--imagenet"}  # what they find depends on this machine
SLOW = {"--seconds": ("inf", "1e308", "1e309"), "--duration": NUMBERS}  # allowed, and long
TAKEN = {"none", "true"}  # words that mean something to some option


@dataclass(frozen=True)
class Option:
    """name: with its dashes; kind: INT, FLOAT, PATH, STR or choices, as --help says."""

    name: str
    kind: str


def random_words(rng: random.Random, good: dict[str, bytes]) -> Attempt:
    """A command line that ends well, and one or two options with values that mostly cannot be."""
    use = rng.choice(BASES)
    known = options(use.line)
    chosen = rng.sample(known, min(len(known), rng.choice((1, 1, 1, 2))))
    words, bad = list(use.arguments), ""
    for option in chosen:
        word = rng.choice([word for word in _words(option, rng) if word not in SLOW.get(option.name, ())] or TEXTS)
        bad = bad or why_bad(option, word)
        words += [f"{option.name}={word}"] if rng.random() < 0.3 else [option.name, word]
    return Attempt(KIND, tuple(word for word in words if "\0" not in word), needed(use, good), bad)


def _words(option: Option, rng: random.Random) -> tuple[str, ...]:
    if option.kind in ("INT", "FLOAT", "N"):
        return NUMBERS if rng.random() < 0.8 else (*TEXTS, *ODD)
    return (*TEXTS, *ODD, *NUMBERS)


def why_bad(option: Option, word: str) -> str:
    """Why an option cannot be this, by what its kind alone says; empty where it may be."""
    if option.name in HEAVY or word in TAKEN or "\0" in word:
        return ""
    if option.kind in ("INT", "FLOAT", "N"):
        try:
            number = float(word) if option.kind == "FLOAT" else int(word)
        except ValueError:
            return f"{option.name} is no number"
        return f"{option.name} is {word}" if number < 0 or math.isnan(number) else ""
    if option.kind.startswith("{"):
        return "" if word in option.kind[1:-1].split(",") else f"{option.name} is none of its choices"
    return f"{option.name} names nothing" if option.name in NAMES and word not in ("recording", "/dev/null") else ""


@lru_cache(maxsize=32)
def options(line: str) -> tuple[Option, ...]:
    """The options with values of a command line's verb."""
    words = shlex.split(line)
    verb = words[: 2 if words[0] == "speed" else 1]
    found = re.findall(
        r"(--[a-z][\w.-]*)(?:, --[\w-]+)? ([A-Z][\w:,\[\]]*|\{[^}]*\}|\[INT \[INT \.\.\.\]\])", help_text(verb)
    )
    return tuple(Option(name, "INT" if kind.startswith("[INT") else kind) for name, kind in dict(found).items())


def help_text(verb: list[str]) -> str:
    """What --help says of a verb, in one narrow column."""
    from caldrive.cli import main

    text, columns = io.StringIO(), os.environ.get("COLUMNS")
    os.environ["COLUMNS"] = "100"
    try:
        with contextlib.redirect_stdout(text), contextlib.suppress(SystemExit):
            main([*verb, "--help"])
    finally:
        os.environ.pop("COLUMNS")
        if columns is not None:
            os.environ["COLUMNS"] = columns
    return text.getvalue()
