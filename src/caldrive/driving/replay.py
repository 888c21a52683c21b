"""Drives a benchmark's episode again, films it, and compares."""

from __future__ import annotations

import json
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from caldrive.datatypes import Step
from caldrive.driving.benchmark import driven
from caldrive.driving.drivers import set_up
from caldrive.driving.film import EpisodeFilm, caption
from caldrive.driving.ledger import RESULTS, read_lines, read_run, require_same_suite
from caldrive.driving.outputs import require_writable_file
from caldrive.driving.referee import Referee
from caldrive.driving.rollout import run_episode
from caldrive.driving.settings import DriverSettings
from caldrive.driving.suites import Trial, suite
from caldrive.driving.trace import result_values
from caldrive.driving.video import VideoWriter
from caldrive.progress import Progress, silent
from caldrive.results import EpisodeResult


@dataclass(frozen=True)
class Replay:
    """An episode driven again: how it went, whether as before, and its video."""

    result: EpisodeResult
    same: bool
    video: Path


def _trial(run: dict[str, Any], key: str) -> Trial:
    trials = suite(run["suite"], run["seed"], run["time_limit"])
    found = [trial for trial in trials if trial.key == key]
    if not found:
        raise ValueError(f"found no episode {key!r} in {run['suite']}, wanted one like {trials[0].key}: type its key")
    return found[0]


def replay(folder: Path, key: str, out: Path, progress: Progress = silent) -> Replay:
    """Drives the episode of a benchmark's folder again, exactly, and writes its video.

    Raises ValueError where there is no such run or episode.
    """
    require_writable_file(out, "--out", ".mp4")
    run = read_run(folder)
    require_same_suite(run)
    trial, known = _trial(run, key), read_lines(folder / RESULTS)
    if key in known:
        driven(trial, known[key])  # refuses another episode of this name
    model = Path(run["model_file"]) if run["model_file"] else None
    world, agent = set_up(DriverSettings(agent=run["agent"], model=model, preset=run["preset"], cap=run["cap"]))
    with closing(world), VideoWriter(out, rate=1 / world.dt) as video:
        referee = Referee(trial.scenario, trial.fatal)
        film = EpisodeFilm(video, world, referee, f"{caption(trial.scenario, 1, 1)}   {key}", truth=True)

        def watch(step: Step) -> None:
            film.add(step)
            progress(key, min(1.0, step.truth.route_done / step.truth.route_length))

        result = run_episode(world, agent, trial.scenario, watch, referee)
        film.end(result)
    same = key in known and known[key]["result"] == json.loads(json.dumps(result_values(result)))
    return Replay(result, same, out)
