"""Runs every verb of an installed caldrive with --json, and the README's Python: does stdout hold the answer only?

    python scripts/every_verb.py

Takes the caldrive of the Python that runs it, such as one in a fresh environment (`make newest`). Each command is a
process of its own, so that what a library prints at its start or end is heard, too.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path

README = Path(__file__).parents[1] / "README.md"
KEY = "town01-w01-straight-00"
# One after the other, in one folder: a later command reads what an earlier one wrote. suite.json holds one short trial.
COMMANDS = {
    "drive": "--seconds 1 --out drive",
    "benchmark": "--suite suite.json --workers 1 --out run",
    "replay": f"run {KEY} --out replay.mp4",
    "report": "run --out report",
    "blame": "run --workers 1",
    "collect": "--episodes 2 --duration 8 --workers 1 --out recording",
    "data": "recording --picture labels.png",
    "convert": "recording --validation-share 0.5 --out corl2017",
    "train": "--data recording --steps 2 --batch 2 --history-steps 1 --history-batch 2 --camera-check-steps 1 "
    "--out training",
    "search": "--data recording --model training/model.safetensors --tasks relative_angle --trials 1 --steps 2 "
    "--batch 2 --seeds 1 --joint-steps 1 --workers 1 --out search",
    "tune": "--auto --trials 2 --routes 0 --maneuvers right --workers 1 --out tune",
    "evaluate": "--data recording --model training/model.safetensors --worst worst.png",
    "see": "labels.png --out see.mp4",
    "explain drive": "--seconds 0.3 --out attention.mp4",
    "explain pictures": "labels.png --out seen.mp4",
    "explain recording": "recording --examples 1 --out attention.png",
    "explain counterfactuals": "--episodes 1 --seconds 2 --cases 1 --out counterfactuals",
    "town": "--town town02 --plan plan.png",
    "speed world": "--town town02 --steps 3",
    "speed agent": "--steps 3",
    "speed env": "--steps 3 --observation affordances --task straight",
    "determinism": "--agent oracle --town town02 --seconds 1",
}
# Trainings like those of the verb train, what ends when it is stopped, and what needs a CARLA.
TAKE_DAYS = ("baselines", "serve-carla", "check-carla")
ERRORS = ("drive --wings 2", "drive --town mars", "report gone", "fly")


def words(command: str) -> list[str]:
    return [*command.split(), "--json"]


def write_suite(path: Path) -> None:
    """One trial of the quick suite, which ends after a second."""
    from caldrive.benchmark.suites import suite, to_json

    rows = json.loads(to_json(suite("quick")[:1]))
    rows[0]["scenario"]["time_limit"] = 1.0
    path.write_text(json.dumps(rows))


def mistake(arguments: list[str], folder: Path, code: int) -> str:
    """What was wrong with one command; empty where nothing was."""
    command = [sys.executable, "-m", "caldrive", *arguments]
    ended = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if ended.returncode != code:
        return f"ended with code {ended.returncode}, wanted {code}: {ended.stderr.strip()}"
    try:
        answer = json.loads(ended.stdout)
    except ValueError:
        return f"printed no JSON, or more than that: {ended.stdout!r}"
    return "" if ("error" in answer) == bool(code) else f"answered {ended.stdout!r}"


def example_mistake(folder: Path) -> str:
    """What was wrong with the README's Python; empty where nothing was."""
    [code] = re.findall(r"^```python\n(.*?)^```$", README.read_text(), re.MULTILINE | re.DOTALL)
    ended = subprocess.run([sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=False)
    well = ended.returncode == 0 and len(ended.stdout.splitlines()) == 1 and "reached the goal" in ended.stdout
    return "" if well else f"said {ended.stdout}{ended.stderr}"


def main() -> int:
    wrong = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_suite(folder / "suite.json")
        cases = [(f"{verb} {options}", 0) for verb, options in COMMANDS.items()] + [(text, 2) for text in ERRORS]
        for command, code in cases:
            found = mistake(words(command), folder, code)
            print(f"caldrive {command}: {found or 'well'}", flush=True)
            wrong += bool(found)
        found = example_mistake(folder)
        print(f"the README's Python: {found or 'well'}")
    return int(bool(wrong or found))


if __name__ == "__main__":
    sys.exit(main())
