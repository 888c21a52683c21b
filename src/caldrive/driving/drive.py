"""Drive episodes, film them, and write down what happened."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from caldrive.agents.registry import agent_entry
from caldrive.checks import require_writable_file, require_writable_folder
from caldrive.datatypes import CameraConfig, Step
from caldrive.driving.choice import chosen_scenarios
from caldrive.driving.referee import Referee
from caldrive.driving.rollout import run_episode
from caldrive.driving.settings import DriveSettings
from caldrive.driving.setup import set_up
from caldrive.driving.trace import Trace, episode_json
from caldrive.files import locked_folder, write_whole
from caldrive.interfaces import World
from caldrive.progress import Progress, silent
from caldrive.results import EpisodeResult, Outcome, result_values
from caldrive.scenarios import Scenario
from caldrive.visualization.channels import Attention, DriveRecording, Writer
from caldrive.visualization.episode_video import EpisodeFilm, VideoWriter, caption
from caldrive.visualization.mcap_file import ENDING, McapFile, require_mcap
from caldrive.visualization.plots import draw_speed
from caldrive.visualization.rerun_view import RerunView, require_rerun


@dataclass(frozen=True)
class DriveReport:
    """How the episodes of a drive went."""

    results: tuple[EpisodeResult, ...]
    """One for each episode."""
    files: tuple[Path, ...]
    """The trace of each (JSON)."""
    video: Path | None
    """The video of all, if one was made."""
    recording: Path | None = None
    """The MCAP file of all, if one was asked for."""

    @property
    def all_reached(self) -> bool:
        """Whether every episode ended at its goal in time."""
        return all(result.outcome is Outcome.SUCCESS for result in self.results)

    def values(self) -> dict[str, Any]:
        """The report in JSON's types."""
        episodes = [
            {"file": str(file), **result_values(result)} for file, result in zip(self.files, self.results, strict=True)
        ]
        made = {"video": self.video, "recording": self.recording}
        return {name: str(path) if path else None for name, path in made.items()} | {"episodes": episodes}


def drive(settings: DriveSettings, progress: Progress = silent, attention: Attention | None = None) -> DriveReport:
    """Drive settings.episodes episodes; writes episode-000.json, 001, ... to settings.out, and with the
    video drive.mp4 also a plot of each episode's speed.

    attention: for recordings, a picture of where the agent looked in an observation. Raises ValueError,
    FileNotFoundError, OSError or RuntimeError with what to type where it cannot be done.
    """
    _require_places(settings)
    scenarios = chosen_scenarios(settings, settings.episodes)
    show_truth = not agent_entry(settings.agent).privileged  # an oracle goes by the truth anyway
    world, agent = set_up(settings, images=settings.record is not None or settings.view)
    results, files = [], []
    with (
        closing(world),
        locked_folder(settings.out),
        VideoWriter(settings.out / "drive.mp4", rate=1 / world.dt) as video,
        _recording(settings, world, attention) as recording,
    ):
        for k, scenario in enumerate(scenarios):
            trace, referee = Trace(), Referee(scenario, signs=settings.cap is None)
            text = caption(scenario, k + 1, len(scenarios))
            film = EpisodeFilm(video, world, scenario, caption=text, infractions=referee.infractions, truth=show_truth)
            watchers = [trace.add, _reporter(progress, scenario, k, len(scenarios))]
            watchers += [film.add] if settings.video else []
            watchers += [recording.add] if recording.writers else []
            recording.begin(scenario, text, referee.infractions)
            result = run_episode(world, agent, scenario, *watchers, referee=referee)
            film.end(result)
            recording.end(result)
            results.append(result)
            files.append(settings.out / f"episode-{k:03d}.json")
            write_whole(files[-1], episode_json(result, trace))
            if settings.video:
                draw_speed(trace.columns(), text, files[-1].with_suffix(".png"))
    return DriveReport(tuple(results), tuple(files), video.path if video.frames else None, settings.record)


def _require_places(settings: DriveSettings) -> None:
    """Raises ValueError, OSError or RuntimeError where something could not be written in the end."""
    require_writable_folder(settings.out)
    if settings.record is not None:
        require_writable_file(settings.record, "--record", ENDING)
        require_mcap()
    if settings.view:
        require_rerun()


@contextmanager
def _recording(settings: DriveSettings, world: World, attention: Attention | None) -> Iterator[DriveRecording]:
    """The recording of a drive, for the file and the viewer that were asked for."""
    camera = agent_entry(settings.agent).camera(settings) or CameraConfig()
    with ExitStack() as stack:
        writers: list[Writer] = []
        if settings.record is not None:
            writers.append(stack.enter_context(McapFile(settings.record)))
        if settings.view:
            writers.append(stack.enter_context(RerunView()))
        yield DriveRecording(writers, world, camera, attention)


def _reporter(progress: Progress, scenario: Scenario, k: int, of: int) -> Callable[[Step], None]:
    """Reports how far the drive has come: by the route, or by the time where that has gone further."""

    def report(step: Step) -> None:
        done = max(step.truth.route_done / step.truth.route_length, step.truth.time / scenario.time_limit)
        progress(f"episode {k + 1} of {of}", (k + min(done, 1.0)) / of)

    return report
