"""Good inputs of every kind, made by the program itself, and the proof that they are good."""

from __future__ import annotations

import io
import json
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from scripts.attack.attempt import Attempt, tree
from scripts.attack.uses import BENCHMARK, COLLECT, TRAIN, USES, Use

Call = Callable[[Attempt], tuple[int, str, Path]]  # runs an attempt: its exit code, what it said, and where it ran
READY = "ready"  # a file that says which kinds were tried
MADE = (  # in this order: command lines, and what they leave
    (COLLECT, "recording"),
    (f"{BENCHMARK} --suite suite.json --out run", "run"),
    (TRAIN, "training"),
    ("see pictures --model training/model.safetensors --out video.mp4", "video.mp4"),
)
WORK_MARK = b"{the folder that this lies in}"  # run.json names its suite by the whole path


def good_files(folder: Path, call: Call, kinds: Sequence[str], uses: Sequence[Use] = USES) -> dict[str, bytes]:
    """The good inputs by name. What some kinds need is made where a folder does not hold it yet, and each of their uses
    is tried.

    Raises RuntimeError where the program does not take them.
    """
    ready = folder / READY
    tried = set(ready.read_text().splitlines()) if ready.is_file() else set()
    files = {name: content for name, content in tree(folder).items() if name != READY} or written_by_hand()
    chosen = [use for use in uses if use.kind in kinds and use.kind not in tried]
    if any(use.needs and not needed(use, files) for use in chosen):
        for line, name in MADE:
            files |= _made(line, name, files, call)
    for use in chosen:
        _ended_well(Attempt(use.kind, use.arguments, needed(use, files)), call)
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    ready.write_text("\n".join(sorted(tried | set(kinds))))
    return files


def needed(use: Use, files: dict[str, bytes]) -> dict[str, bytes]:
    """The good files that a command line needs, nothing where one of them is not there."""
    found = {need: [name for name in files if name == need or name.startswith(f"{need}/")] for need in use.needs}
    return {name: files[name] for names in found.values() for name in names} if all(found.values()) else {}


def _made(line: str, name: str, files: dict[str, bytes], call: Call) -> dict[str, bytes]:
    """What a command line leaves under a name."""
    work = _ended_well(Attempt("good", tuple(line.split()), files), call)
    made = {key: content for key, content in tree(work).items() if key == name or key.startswith(f"{name}/")}
    return {key: content.replace(str(work).encode(), WORK_MARK) for key, content in made.items()}


def _ended_well(attempt: Attempt, call: Call) -> Path:
    code, said, work = call(attempt)
    if code:
        raise RuntimeError(
            f"caldrive {' '.join(attempt.arguments)} refuses a good input of kind {attempt.kind}: {said}"
        )
    return work


def written_by_hand() -> dict[str, bytes]:
    """Those that the program does not make."""
    files = {name: content.encode() for name, content in TEXTS.items()}
    rng = np.random.default_rng(0)
    for k, kind in enumerate(("PNG", "JPEG", "PNG")):
        buffer = io.BytesIO()
        Image.fromarray(rng.integers(0, 256, (44, 100, 3), np.uint8)).save(buffer, kind)
        files[f"pictures/{k}.{'jpg' if kind == 'JPEG' else 'png'}"] = buffer.getvalue()
    files["suite.json"] = json.dumps([_trial(k, "town01", START, GOAL) for k in range(2)]).encode()
    start, goal = {"x": 20.0, "y": -2.0, "heading": 0.0}, {"x": 80.0, "y": -2.0, "heading": 0.0}
    files["own_map.json"] = json.dumps([_trial(0, "map.xodr", start, goal)]).encode()
    return files | {"crossing.xodr": _crossing()}


def _trial(k: int, town: str, start: dict[str, float], goal: dict[str, float]) -> dict[str, object]:
    scenario = {
        "town": town, "weather": 1 + k, "start": start, "goal": goal, "n_vehicles": 2 * k, "n_pedestrians": 3 * k,
        "time_limit": 0.6, "seed": k, "task": "short", "crossing": 1.0,
    }  # fmt: skip
    return {"key": f"short-{k}", "condition": "short", "fatal": ["collision with car"], "scenario": scenario}


def _crossing() -> bytes:
    """A map of four roads that meet, by SUMO's own tools."""
    import sumo

    binaries = Path(sumo.SUMO_HOME) / "bin"
    with tempfile.TemporaryDirectory() as name:
        grid, own = Path(name) / "grid.net.xml", Path(name) / "crossing.xodr"
        size = ["--grid.x-number=1", "--grid.y-number=1", "--grid.attach-length=120", "--default.lanenumber=1"]
        for words in (
            ["netgenerate", "--grid", *size, f"-o{grid}"],
            ["netconvert", f"-s{grid}", f"--opendrive-output={own}"],
        ):
            environment = {"SUMO_HOME": sumo.SUMO_HOME}
            subprocess.run([binaries / words[0], *words[1:]], check=True, capture_output=True, env=environment)
        return own.read_bytes()


START, GOAL = {"x": 268.0, "y": 53.946, "heading": -1.571}, {"x": 179.204, "y": 332.0, "heading": 3.142}  # in town01
TEXTS = {
    "drive.toml": 'town = "town01"\nweather = 3\ntask = "straight"\ncap = 20.0\ncars = 2\npeople = 3\nseed = 1\n'
    "route = 2\n",
    "recording.toml": "episodes = 2\nduration = 0.6\nweathers = [1, 3]\ncars = 3\npeople = 4\nwidth = 64\nheight = 32\n"
    "crossing = 2.0\nbefore_signs = 0.5\ntailgating = 0.2\nrandomised = 0.0\nsemantic = true\nseed = 1\n",
    "controller.toml": 'preset = "paper"\ncap = 20.0\ninitial_limit = 30.0\n[longitudinal]\nturn_speed = 15.0\n'
    "[longitudinal.cruise]\nkp = 0.09\nki = 0.02\n[lateral]\nleft = [0.5, 0.05]\n[patience]\nenabled = false\n",
    "training.toml": "steps = 2\nbatch = 2\nwindow = 2\nhistory_steps = 1\nhistory_batch = 2\nsave_every = 1\n"
    'validation_share = 0.5\nlearning_rate = 0.001\ndevice = "cpu"\nprecision = "fp32"\nseed = 1\n'
    "[loss_weights]\nred_light = 2.0\n[augmentation]\nblur = 1.0\n[recolour]\nshare = 0.5\n"
    "[network]\nimage_width = 64\nimage_height = 32\nwidth = 0.125\n"
    '[network.red_light]\nlayer = "gru"\nnodes = 8\ndropout = 0.1\nlength = 2\ndilation = 1\nnorm = "none"\n',
    "map.xodr": """<?xml version="1.0"?><OpenDRIVE><header revMajor="1" revMinor="4" name="" version="1.0"/>
<road name="" length="100" id="1" junction="-1"><link/><planView><geometry s="0" x="0" y="0" hdg="0" length="100">
<line/></geometry></planView><lanes><laneSection s="0">
<left><lane id="1" type="driving" level="false"><link/><width sOffset="0" a="4" b="0" c="0" d="0"/></lane></left>
<center><lane id="0" type="none" level="false"/></center>
<right><lane id="-1" type="driving" level="false"><link/><width sOffset="0" a="4" b="0" c="0" d="0"/></lane></right>
</laneSection></lanes><objects></objects><signals>
<signal id="7" s="50" t="-5" type="274" value="60" orientation="+" dynamic="no"/>
<signal id="8" s="90" t="-5" type="1000001" orientation="+" dynamic="yes"/></signals></road></OpenDRIVE>
""",
}  # fmt: skip
