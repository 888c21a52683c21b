"""What is tried: good inputs made by the program itself, and everything bad that is made of them."""

from __future__ import annotations

import io
import json
import random
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from PIL import Image

from scripts.attack.mutations import WORDS, of_bytes, of_json, of_text

SHORT = ("--seconds", "0.3", "--no-video")
DRIVE = ("drive", "--agent", "oracle", *SHORT)
SIZE = ("--width", "64", "--height", "32")


@dataclass(frozen=True)
class Attempt:
    """A command line, and the files that it meets. {dir} in a word stands for its folder; {good} for that of the good
    inputs. bad: it must not run."""

    kind: str
    arguments: tuple[str, ...]
    files: dict[str, bytes] = field(default_factory=dict)
    bad: bool = False


def prepare(folder: Path, call: Callable[[list[str]], int]) -> None:
    """Makes the good inputs once. call: runs a command line of the program."""
    if (folder / "ready").exists():
        return
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    from caldrive.benchmark.suites import suite, to_json

    values = json.loads(to_json(suite("quick")[4:6]))
    for row in values:
        row["scenario"]["time_limit"] = 1.0
    (folder / "suite.json").write_text(json.dumps(values))
    recording = ["collect", "--out", str(folder / "recording"), "--episodes", "2", "--duration", "0.6", *SIZE]
    commands = [
        [*recording, "--cars", "3", "--people", "3", "--workers", "1"],
        ["benchmark", "--suite", str(folder / "suite.json"), "--agent", "oracle", "--out", str(folder / "run"),
         "--workers", "1"],
    ]  # fmt: skip
    for command in commands:
        if call(command):
            raise RuntimeError(f"could not make a good input: caldrive {' '.join(command)}")
    image = Image.fromarray(np.random.default_rng(0).integers(0, 256, (88, 200, 3), np.uint8))
    for k in range(3):
        image.save(folder / f"picture{k}.png")
    (folder / "map.xodr").write_text(MAP)
    (folder / "ready").touch()


def attempts(good: Path, rng: random.Random) -> Iterator[Attempt]:
    """Without end, each kind in turn."""
    makers = [_values, _settings, _suites, _results, _recordings, _checkpoints, _maps, _pictures, _code]
    while True:
        for maker in makers:
            yield maker(good, rng)


def _values(good: Path, rng: random.Random) -> Attempt:
    """An option with a value of no sense."""
    verb, options = rng.choice(OPTIONS)
    chosen = rng.sample(options, min(len(options), rng.choice((1, 1, 2))))
    words = [word for option in chosen for word in (option, rng.choice(WORDS))]
    if rng.random() < 0.1:
        words = [rng.choice(WORDS), *words]
    return Attempt("command line", (*verb, *[w for w in words if "\x00" not in w]))


def _settings(good: Path, rng: random.Random) -> Attempt:
    name = rng.choice(("drive", "controller", "collect"))
    text = TOML[name]
    changed = {"own.toml": of_text(text.encode(), rng)}
    if name == "controller":
        return Attempt("settings", (*DRIVE, "--controller", "{dir}/own.toml"), changed)
    verb = DRIVE if name == "drive" else ("collect", "--out", "{dir}/out", "--workers", "1")
    return Attempt("settings", (*verb, "--config", "{dir}/own.toml"), changed)


def _suites(good: Path, rng: random.Random) -> Attempt:
    files = {"own.json": of_json((good / "suite.json").read_bytes(), rng)}
    words = ("benchmark", "--suite", "{dir}/own.json", "--agent", "oracle", "--workers", "1", "--out", "{dir}/out")
    return Attempt("suite", words, files)


def _results(good: Path, rng: random.Random) -> Attempt:
    files = _tree(good / "run", "run")
    name = rng.choice([name for name in files if not name.endswith(".jpg")])
    change = of_json if name.endswith("run.json") else of_bytes
    if name.endswith("results.jsonl") and rng.random() < 0.6:
        lines = files[name].splitlines()
        at = rng.randrange(len(lines))
        files[name] = b"\n".join([*lines[:at], of_json(lines[at], rng), *lines[at + 1 :]]) + b"\n"
    else:
        files[name] = change(files[name], rng)
    verb = rng.choice([
        ("report", "{dir}/run", "--out", "{dir}/page"),
        ("benchmark", "--suite", "{good}/suite.json", "--agent", "oracle", "--workers", "1", "--out", "{dir}/run"),
    ])  # fmt: skip
    return Attempt("results", verb, files)


def _recordings(good: Path, rng: random.Random) -> Attempt:
    files = _tree(good / "recording", "recording")
    name = rng.choice(list(files))
    files[name] = of_json(files[name], rng) if name.endswith(".json") else of_bytes(files[name], rng)
    verb = rng.choice([
        ("data", "{dir}/recording", "--picture", "{dir}/labels.png"),
        ("collect", "--out", "{dir}/recording", "--episodes", "2", "--duration", "0.6", *SIZE, "--cars", "3",
         "--people", "3", "--workers", "1"),
        ("evaluate", "--data", "{dir}/recording"),
    ])  # fmt: skip
    return Attempt("recording", verb, files)


def _checkpoints(good: Path, rng: random.Random) -> Attempt:
    from caldrive.agents.registry import SHIPPED_MODEL

    content = SHIPPED_MODEL.read_bytes()
    size = int.from_bytes(content[:8], "little")
    header, rest = content[8 : 8 + size], content[8 + size :]
    kind = rng.random()
    if kind < 0.5:
        header = of_json(header.rstrip(), rng)
        content = len(header).to_bytes(8, "little") + header + rest
    elif kind < 0.8:
        content = of_bytes(content, rng)
    else:
        content = content[: 8 + size] + bytes(len(rest))
    verb = rng.choice([("drive", *SHORT), ("speed", "agent", "--steps", "3")])
    return Attempt("network", (*verb, "--model", "{dir}/own.safetensors"), {"own.safetensors": content})


def _maps(good: Path, rng: random.Random) -> Attempt:
    files = {"own.xodr": of_text((good / "map.xodr").read_bytes(), rng)}
    verb = rng.choice([
        (*DRIVE, "--from", "20,-2", "--to", "80,-2"), ("town", "--plan", "{dir}/plan.png"),
        (*DRIVE, "--task", "straight"),
    ])  # fmt: skip
    return Attempt("map", (*verb, "--town", "{dir}/own.xodr"), files)


def _pictures(good: Path, rng: random.Random) -> Attempt:
    files = {f"pictures/{k}.png": (good / f"picture{k}.png").read_bytes() for k in range(3)}
    name = rng.choice(list(files))
    if rng.random() < 0.3:
        buffer = io.BytesIO()
        size = rng.choice(((1, 1), (3000, 2), (2, 3000), (33, 17)))
        Image.new(rng.choice(("L", "RGBA", "1", "RGB")), size).save(buffer, "PNG")
        files[name] = buffer.getvalue()
    else:
        files[name] = of_bytes(files[name], rng)
    crop = rng.choice(((), ("--crop", rng.choice((*WORDS, "0:10", "10:0", "0:9999")))))
    return Attempt("picture", ("see", "{dir}/pictures", "--out", "{dir}/seen.mp4", *crop), files)


def _code(good: Path, rng: random.Random) -> Attempt:
    """Somebody's own agent or controller that is no use."""
    body = rng.choice(CODE)
    option = rng.choice(("--agent", "--controller"))
    words = DRIVE if option == "--controller" else ("drive", *SHORT)
    return Attempt("own code", (*words, option, "{dir}/own.py:Own"), {"own.py": body.encode()})


def _tree(folder: Path, name: str) -> dict[str, bytes]:
    paths = sorted(path for path in folder.rglob("*") if path.is_file())
    return {f"{name}/{path.relative_to(folder)}": path.read_bytes() for path in paths}


TOML = {
    "drive": 'town = "town01"\nweather = 3\ntask = "straight"\ncap = 20.0\ncars = 2\npeople = 3\nseed = 1\nroute = 2\n',
    "collect": 'episodes = 1\nduration = 0.5\nweathers = [1, 3]\ncars = 3\npeople = 4\nwidth = 64\nheight = 32\n',
    "controller": "preset = \"paper\"\ncap = 20.0\ninitial_limit = 30.0\n[longitudinal]\nturn_speed = 15.0\n"
    "[longitudinal.cruise]\nkp = 0.09\nki = 0.02\n[lateral]\nleft = [0.5, 0.05]\n[patience]\nenabled = false\n",
}  # fmt: skip
CODE = (
    "", "x =", "Own = 3", "class Own: pass", "class Own:\n def act(self, o): return None",
    "class Own:\n def act(self, o): return 1 / 0", "import nothing_of_this_name", "raise SystemExit(3)",
    "class Own:\n def __init__(self, a): pass", "class Own:\n def act(self): pass",
    "from caldrive import Control\nclass Own:\n def act(self, o): return Control(9, 0, 0)",
    "class Own:\n decision = 5\n def act(self, o):\n  from caldrive import Control\n  return Control()",
    "class Own:\n camera = 7\n def act(self, o): return o",
    "class Own:\n def reset(self): pass\n def step(self, a, s, c): return None",
    "class Own:\n def reset(self): raise KeyError(3)\n def step(self, a, s, c): return 3\n def act(self, o): return 3",
    "import sys\nsys.exit()", "class Own:\n act = 5\n step = 6", "def Own(): return None",
)  # fmt: skip
MAP = """<?xml version="1.0"?><OpenDRIVE><header revMajor="1" revMinor="4" name="" version="1.0"/>
<road name="" length="100" id="1" junction="-1"><link/><planView><geometry s="0" x="0" y="0" hdg="0" length="100">
<line/></geometry></planView><lanes><laneSection s="0">
<left><lane id="1" type="driving" level="false"><link/><width sOffset="0" a="4" b="0" c="0" d="0"/></lane></left>
<center><lane id="0" type="none" level="false"/></center>
<right><lane id="-1" type="driving" level="false"><link/><width sOffset="0" a="4" b="0" c="0" d="0"/></lane></right>
</laneSection></lanes><objects></objects><signals>
<signal id="7" s="50" t="-5" type="274" value="60" orientation="+" dynamic="no"/>
<signal id="8" s="90" t="-5" type="1000001" orientation="+" dynamic="yes"/></signals></road></OpenDRIVE>
"""
_EPISODE = ["--agent", "--town", "--task", "--weather", "--cars", "--people", "--route", "--seed", "--cap", "--seconds",
            "--controller", "--world", "--from", "--to", "--episodes", "--out", "--model"]  # fmt: skip
OPTIONS: tuple[tuple[tuple[str, ...], list[str]], ...] = (
    (DRIVE, _EPISODE),
    (("drive", *SHORT), ["--model", "--agent"]),
    (("determinism", "--agent", "oracle", "--seconds", "0.2"), ["--town", "--task", "--weather", "--cars", "--seed"]),
    (("town", "--sheet", "{dir}/t.png"), ["--town", "--width", "--randomised", "--sheet"]),
    (("town", "--plan", "{dir}/t.png"), ["--town", "--width", "--plan"]),
    (("collect", "--episodes", "1", "--duration", "0.3", *SIZE, "--workers", "1", "--out", "{dir}/out"),
     ["--town", "--weathers", "--episodes", "--duration", "--cars", "--people", "--crossing", "--before-signs",
      "--displaced", "--randomised", "--tailgating", "--width", "--height", "--seed", "--out", "--workers"]),
    (("data",), ["--picture"]),
    (("train", "--data", "{good}/recording", "--out", "{dir}/out", "--steps", "1"),
     ["--data", "--preset", "--steps", "--rate", "--seed", "--device", "--initial", "--imagenet", "--out"]),
    (("evaluate", "--data", "{good}/recording"), ["--model", "--precision", "--worst", "--data"]),
    (("benchmark", "--suite", "{good}/suite.json", "--agent", "oracle", "--workers", "1", "--out", "{dir}/out"),
     ["--suite", "--agent", "--cap", "--controller", "--workers", "--seed", "--time-limit", "--known", "--ray",
      "--out"]),
    (("report", "{good}/run", "--out", "{dir}/page"), ["--out"]),
    (("replay", "{good}/run"), ["--out"]),
    (("speed", "world", "--steps", "3", "--cars", "2", "--people", "2"),
     ["--town", "--weather", "--cars", "--people", "--steps", "--seed"]),
    (("speed", "agent", "--steps", "3"), ["--model", "--threads", "--steps", "--agent"]),
    (("see", "{good}", "--out", "{dir}/seen.mp4"), ["--crop", "--command", "--model", "--out", "--values"]),
)  # fmt: skip
