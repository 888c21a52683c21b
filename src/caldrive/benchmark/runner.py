"""The runner: drives a suite with several workers, and can be killed at any moment.

A trial's result depends on the trial and on who drives only, so the lines of a run that was broken off ten times are
those of an unbroken one, in another order.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any

from caldrive.agents.settings import AgentSettings
from caldrive.benchmark.artifacts import EpisodeArtifacts
from caldrive.benchmark.episode_metrics import EpisodeMetrics
from caldrive.benchmark.generated_suites import GENERATED_SUITES
from caldrive.benchmark.reuse import reusable_records
from caldrive.benchmark.run_folder import EpisodeRecord, RunFolder, driver_provenance
from caldrive.benchmark.settings import BenchmarkSettings
from caldrive.benchmark.suites import SUITES, Towns, Trial, suite
from caldrive.checks import MOST_SEED, MOST_WORKERS, require_within, require_writable_folder
from caldrive.driving.own_code import OwnCodeError
from caldrive.driving.referee import Referee
from caldrive.driving.rollout import run_episode
from caldrive.driving.rules import RULES
from caldrive.driving.setup import planned_town, require_embedded, set_up
from caldrive.files import locked_folder
from caldrive.interfaces import Agent, World
from caldrive.parallel.processes import parallel_map
from caldrive.parallel.ray_cluster import cluster_map, require_ray
from caldrive.results import plain, result_values
from caldrive.scenarios import TOWNS, Scenario
from caldrive.world.roads.route import plan_route
from caldrive.world.roads.towns import load_roads
from caldrive.world.scene.weather import weather
from caldrive.world.traffic.sidewalks import require_room
from caldrive.world.traffic.start_places import free_places


@lru_cache(maxsize=1)
def _worker(driver: AgentSettings) -> tuple[World, Agent, dict[str, Any]]:
    """One world, agent and provenance for each process."""
    return *set_up(driver), driver_provenance(driver)


def _close_worker(driver: AgentSettings) -> None:
    """Closes the world of this process, if a trial was driven in it."""
    if _worker.cache_info().currsize:
        _worker(driver)[0].close()
        _worker.cache_clear()


def drive_trial(driver: AgentSettings, trial: Trial) -> EpisodeRecord:
    """What a worker does: drives one trial, and returns all that is kept of it. Raises OwnCodeError with its key."""
    world, agent, provenance = _worker(driver)
    referee = make_referee(driver, trial)
    metrics, artifacts = EpisodeMetrics(), EpisodeArtifacts(world, referee)
    try:
        result = run_episode(world, agent, trial.scenario, metrics.add, artifacts.add, referee=referee)
    except OwnCodeError as error:
        raise OwnCodeError(f"{error} (in episode {trial.key})") from error
    figures = {name: plain(value) for name, value in metrics.compute(result.infractions).items()}
    line = {"key": trial.key, "result": result_values(result), "figures": figures}
    return EpisodeRecord(line=line, files=artifacts.files(trial.key, result), provenance=provenance)


def make_referee(driver: AgentSettings, trial: Trial) -> Referee:
    """A trial's referee. A driver without a cap is told to obey the signs."""
    return Referee(trial.scenario, trial.fatal, RULES[trial.rules], signs=driver.cap is None)


@dataclass(frozen=True)
class RunProgress:
    """How far a run is."""

    done: int
    """Trials that are done."""
    total: int
    """Trials of the suite."""
    success: bool
    """Whether the last one reached its goal."""


def benchmark(settings: BenchmarkSettings) -> Iterator[RunProgress]:
    """Drives the trials that a folder lacks; yields how far the run is.

    Raises ValueError where a folder belongs to another run, OwnCodeError where the agent fails, RuntimeError where
    workers keep dying or Ray is missing.
    """
    known = [RunFolder(folder) for folder in settings.known]
    _check(settings)
    towns = _towns(settings)
    trials = _checked_trials(settings, towns)
    driven_by = driver_provenance(settings.driver)  # looks at agent and network before there is a folder
    with locked_folder(settings.out):
        folder = RunFolder.claim(settings, trials, driven_by, towns)
        for record in reusable_records(known, folder.missing(), folder.description):
            folder.save(record)
        missing = folder.missing()
        done = len(folder.trials) - len(missing)
        try:
            for record in _drive(settings, partial(drive_trial, settings.driver), missing):
                folder.save(record)
                done += 1
                success = record.line["result"]["outcome"] == "success"
                yield RunProgress(done=done, total=len(folder.trials), success=success)
        finally:
            _close_worker(settings.driver)


def _check(settings: BenchmarkSettings) -> None:
    """Refuses what no benchmark can be made of before a folder is claimed, or a server asked."""
    require_within("--workers", settings.workers, 1, MOST_WORKERS, 2)
    require_within("--seed", settings.seed, 0, MOST_SEED, 0)
    if settings.ray is not None:
        require_embedded(settings)
        require_ray()
    if settings.cap is not None:
        require_within("--cap", settings.cap, 1.0, 200.0, 20)
    if settings.suite not in SUITES and (settings.seed, settings.time_limit) != (0, "paper"):
        raise ValueError(
            f"found --seed or --time-limit with {settings.suite}, whose trials have their own: leave them out"
        )
    if not settings.is_mapped:
        raise ValueError(
            f"found --world {settings.world}, wanted one with towns that the suites know: type --world embedded or "
            "--world carla"
        )
    require_writable_folder(settings.out)


def _towns(settings: BenchmarkSettings) -> dict[str, str]:
    """The maps of CARLA's that stand for the suite's towns, where it drives there."""
    if settings.world == "embedded" or settings.suite not in SUITES or settings.suite in GENERATED_SUITES:
        return {}
    towns = {town: planned_town(settings, town) for town in TOWNS}
    return {town: place for town, place in towns.items() if place != town}


def _checked_trials(settings: BenchmarkSettings, towns: Towns) -> list[Trial]:
    """The suite's trials."""
    trials = suite(settings.suite, settings.seed, settings.time_limit, towns)
    if settings.suite not in SUITES:
        _check_trials(settings.suite, trials)
    return trials


def _check_trials(name: str, trials: list[Trial]) -> None:
    """Refuses towns, weathers and ways that there are not, and more cars or people than there is room for."""
    for trial in trials:
        try:
            _check_scenario(trial.scenario)
        except (ValueError, OSError) as error:
            raise ValueError(
                f"found that {trial.key} in {name} cannot be driven ({error}): change its scenario"
            ) from error


def _check_scenario(scenario: Scenario) -> None:
    weather(scenario.weather)
    roads = load_roads(scenario.town)
    route = plan_route(roads, scenario.start, scenario.goal)
    free_places(roads, scenario.n_vehicles, route.line.pose_at(0.0))
    require_room(roads, scenario.n_pedestrians)


def _drive(
    settings: BenchmarkSettings, work: Callable[[Trial], EpisodeRecord], trials: list[Trial]
) -> Iterator[EpisodeRecord]:
    """The trials' records as they are done, by processes of this machine or by Ray's."""
    if settings.ray is None:
        results = parallel_map(work, trials, 1 if settings.world == "carla" else settings.workers)
    else:
        results = cluster_map(work, trials, settings.workers, settings.ray)
    return (record for _, record in results)
