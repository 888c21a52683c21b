"""Drives a benchmark's episode again, films it, and compares."""

from __future__ import annotations

import json
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from caldrive.benchmark.run_folder import RunFolder, trial_result
from caldrive.benchmark.runner import make_referee
from caldrive.benchmark.suites import Trial
from caldrive.checks import require_writable_file
from caldrive.datatypes import Step
from caldrive.driving.rollout import run_episode
from caldrive.driving.setup import set_up
from caldrive.progress import Progress, silent
from caldrive.results import EpisodeResult, result_values
from caldrive.visualization.episode_video import EpisodeFilm, VideoWriter, caption


@dataclass(frozen=True)
class Replay:
    """An episode driven again."""

    result: EpisodeResult
    """How it went."""
    same: bool
    """Whether it went as before; false where there is no earlier result."""
    video: Path
    """Its video (MP4)."""


def replay(path: Path, key: str, out: Path, progress: Progress = silent) -> Replay:
    """Drives the episode of a run's folder again, exactly, and writes its video.

    Raises ValueError where there is no such run or episode.
    """
    require_writable_file(out, "--out", ".mp4")
    folder = RunFolder(path)
    trial = next((trial for trial in folder.trials if trial.key == key), None)
    if trial is None:
        suite, example = folder.description["suite"], folder.trials[0].key
        raise ValueError(f"found no episode {key!r} in {suite}, wanted one like {example}: type its key")
    line = folder.lines().get(key)
    if line is not None:
        trial_result(trial, line)  # refuses another episode of this name
    result = _film(folder, trial, out, progress)
    same = line is not None and line["result"] == json.loads(json.dumps(result_values(result)))
    return Replay(result=result, same=same, video=out)


def _film(folder: RunFolder, trial: Trial, out: Path, progress: Progress) -> EpisodeResult:
    """Drives a trial as the folder's run did, and films it."""
    world, agent = set_up(folder.driver)
    with closing(world), VideoWriter(out, rate=1 / world.dt) as video:
        referee = make_referee(folder.driver, trial)
        text = f"{caption(trial.scenario, 1, 1)}   {trial.key}"
        film = EpisodeFilm(video, world, trial.scenario, caption=text, infractions=referee.infractions, truth=True)

        def report(step: Step) -> None:
            progress(trial.key, min(1.0, step.truth.route_done / step.truth.route_length))

        result = run_episode(world, agent, trial.scenario, film.add, report, referee=referee)
        film.end(result)
    return result
