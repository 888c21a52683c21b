"""Inputs that are known to be bad, and why: each must be refused."""

from __future__ import annotations

import json
import random
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from scripts.attack.attempt import Attempt
from scripts.attack.code import AGENTS, CONTROLLERS, MAYBE, WORLDS
from scripts.attack.uses import BENCHMARK, DRIVE

CODE = "own code"
LINES = Path(__file__).with_name("command_lines.txt")  # beginnings that are good, and indented below them bad ends
SETTINGS = {
    "drive.toml": """cap = "fast" | cap = nan | cap = -20.0 | cars = 2.5 | cars = true | cars = [2] | none = 3 | [cap]
        cap = 1; cap = 2 | seed = -1 | out = 3 | json = 3 | config = "drive.toml" | town = "" | weather = 1e9
        seconds = "long" | agent = 3 | video = "no" | episodes = 0""",
    "controller.toml": """cap = 0 | cap = nan | preset = "none" | preset = 3 | longitudinal = 3
        initial_limit = nan | initial_limit = -5 | [none] | [longitudinal.cruise]; kp = nan
        [longitudinal.cruise]; kp = inf | [lateral]; left = [0.5]
        [lateral]; left = ["a", "b"] | [patience]; enabled = 3 | [longitudinal]; turn_speed = nan
        [longitudinal]; hazard_threshold = 7 | [longitudinal]; follow_gap = nan""",
}
SCENARIOS: dict[str, tuple[Any, ...]] = {
    "weather": (0, 15, -1, 1.5, "1", None, True), "n_vehicles": (-1, 100_000, 2.5, "3", None),
    "n_pedestrians": (-1, 10**9, None), "time_limit": (0, -1, "long"), "seed": (-1, 2**70, "0", None),
    "crossing": (-1, "often", None), "town": ("", "none", "none.xodr", "suite.json", "/dev/null", 3, None, "\0"),
    "start": ({"x": 1e9, "y": 0.0, "heading": 0.0}, {"x": 0.0}, None, [0, 0, 0], {"x": "0", "y": 0, "heading": 0}),
    "goal": ({"x": -1e9, "y": 0.0, "heading": 0.0}, {}, {"x": None, "y": 0, "heading": 0}), "none": (3,),
}  # fmt: skip
TRIALS: dict[str, tuple[Any, ...]] = {
    "key": ("", "../x", "/x", "a/b", "x" * 300, 3, None, "\0", "💥"), "condition": (3, None),
    "scenario": (None, 3, [], {}), "fatal": (["none"], 3, [3], "collision with car"),
}  # fmt: skip
NUMBERS = ("0.5", "-1", "2", "1e308", "float('nan')", "float('inf')", "None", "'x'", "True", "np.float32(0.3)",
           "10**400", "np.array([0.1])", "np.nan", "1j", "[]", "-0.0")  # fmt: skip


def attempts(good: dict[str, bytes]) -> list[Attempt]:
    """All of them. good: the good inputs by name, of which each gets a copy."""
    return [*_lines(good), *_settings(), *_suites(good), *_code()]


def _parts(text: str) -> list[str]:
    return [part.strip() for line in text.splitlines() for part in line.split("|")]


def _lines(good: dict[str, bytes]) -> Iterator[Attempt]:
    base = ""
    for line in LINES.read_text().splitlines():
        if not line.startswith(" "):
            base = line.removeprefix("caldrive")
            continue
        for end in _parts(line):
            words = (*shlex.split(base), *shlex.split(end))
            yield Attempt("command line", words, good, f"{end} cannot be")


def _settings() -> Iterator[Attempt]:
    for name, text in SETTINGS.items():
        words = (*shlex.split(DRIVE), "--controller" if name == "controller.toml" else "--config", name)
        for part in _parts(text):
            yield Attempt("settings", words, {name: part.replace("; ", "\n").encode()}, f"{part} cannot be")


def _suites(good: dict[str, bytes]) -> Iterator[Attempt]:
    words = tuple(shlex.split(f"{BENCHMARK} --suite suite.json --out out"))
    trial = json.loads(good["suite.json"])[0]
    texts = {"no trials": b"[]", "a key twice": json.dumps([trial, trial]).encode()}
    texts |= {f"the text {text!r}": text for text in (b"", b"{}", b"null", b"[null]", b"[[]]", b"\xff")}
    for name, values in TRIALS.items():
        texts |= {f"{name} {value!r:.40}": json.dumps([trial | {name: value}]).encode() for value in values}
    for name, values in SCENARIOS.items():
        changed = {f"{name} {value!r:.40}": trial["scenario"] | {name: value} for value in values}
        texts |= {what: json.dumps([trial | {"scenario": values}]).encode() for what, values in changed.items()}
    for what, text in texts.items():
        yield Attempt("suite", words, {"suite.json": text}, f"{what} cannot be")


def _code() -> Iterator[Attempt]:
    for option, bodies in (("--agent", AGENTS), ("--controller", CONTROLLERS), ("--world", WORLDS)):
        for body in bodies:
            yield Attempt(CODE, _driven_by(option), {"own.py": body.encode()}, f"no {option[2:]} can be like this")


def random_code(rng: random.Random) -> Attempt:
    """An agent or a controller that gives any values."""
    option, body = rng.choice(MAYBE)
    while "?" in body:
        body = body.replace("?", rng.choice(NUMBERS), 1)
    return Attempt(CODE, _driven_by(option), {"own.py": body.encode()})


def _driven_by(option: str) -> tuple[str, ...]:
    line = DRIVE.replace("--agent oracle", "") if option == "--agent" else DRIVE
    more = " --from 1,1 --to 50,1" if option == "--world" else ""
    return tuple(shlex.split(f"{line} {option} own.py:Own{more}"))
