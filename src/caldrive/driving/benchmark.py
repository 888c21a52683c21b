"""The runner: drives a suite with several workers, and can be killed at any moment.

What a trial gives depends on the trial and on what drives only, so the lines of a run that was broken off ten times are
those of an unbroken one, in another order.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

from caldrive.datatypes import Scenario
from caldrive.driving.cluster import require_ray, spread_over_cluster
from caldrive.driving.drivers import controller_config, require_agent
from caldrive.driving.ledger import RESULTS, append, claim, held, provenance, read_lines, read_run
from caldrive.driving.limits import MOST_SEED, MOST_WORKERS, require_within
from caldrive.driving.outputs import require_writable_folder
from caldrive.driving.pool import spread
from caldrive.driving.reuse import driven_elsewhere
from caldrive.driving.settings import BenchmarkSettings, DriverSettings
from caldrive.driving.suites import SUITES, Driven, Trial, suite
from caldrive.driving.trace import result_from_values
from caldrive.driving.worker import TrialRecord, drive_trial
from caldrive.files import write_whole
from caldrive.world.pedestrians import require_room
from caldrive.world.route import plan_route
from caldrive.world.towns import load_town
from caldrive.world.traffic import free_places
from caldrive.world.weather import weather


def read_results(settings: BenchmarkSettings) -> list[Driven]:
    """What a folder holds of a suite, in the suite's order. Raises ValueError where it is of an older suite."""
    lines = read_lines(settings.out / RESULTS)
    trials = suite(settings.suite, settings.seed, settings.time_limit)
    return [driven(trial, lines[trial.key]) for trial in trials if trial.key in lines]


def driven(trial: Trial, line: dict[str, Any]) -> Driven:
    """A trial and its line. Raises ValueError where the line is of an older suite's trial of this name."""
    result = result_from_values(line["result"])
    if result.scenario != trial.scenario:
        raise ValueError(
            f"found that {trial.key} was another episode when it was driven: type caldrive benchmark --out ANOTHER"
        )
    return Driven(trial, result, line["figures"])


def benchmark(settings: BenchmarkSettings) -> Iterator[tuple[int, int, bool]]:
    """Drives the trials that a folder lacks; yields how many are done, of how many, and whether the last one succeeded.

    Raises ValueError where a folder belongs to another run, RuntimeError where workers keep dying or Ray is missing.
    """
    _check(settings)
    trials = suite(settings.suite, settings.seed, settings.time_limit)
    if settings.suite not in SUITES:
        _check_places(settings.suite, trials)
    model = settings.model.resolve() if settings.model else None  # workers elsewhere stand in other folders
    driver = DriverSettings(agent=settings.agent, model=model, preset=settings.preset, cap=settings.pace)
    require_writable_folder(settings.out)
    ours = provenance(driver)  # looks at the network before there is a folder
    with held(settings.out):
        claim(settings, ours)
        yield from _benchmark(settings, driver, trials, ours)


def _check(settings: BenchmarkSettings) -> None:
    """Refuses what no benchmark can be made of before a folder is claimed."""
    require_within("--workers", settings.workers, 1, MOST_WORKERS, 2)
    require_within("--seed", settings.seed, 0, MOST_SEED, 0)
    require_agent(settings.agent)
    for folder in settings.known:
        read_run(folder)
    if settings.ray is not None:
        require_ray()
    controller_config(settings.preset, settings.pace)
    if settings.suite not in SUITES and (settings.seed, settings.time_limit) != (0, "paper"):
        raise ValueError(
            f"found --seed or --time-limit with {settings.suite}, whose trials have their own: leave them out"
        )


def _check_places(suite: str, trials: list[Trial]) -> None:
    """Refuses towns, weathers and ways that there are not, and more cars or people than there is room for."""
    for trial in trials:
        try:
            _check_place(trial.scenario)
        except (ValueError, OSError) as error:
            raise ValueError(
                f"found that {trial.key} in {suite} cannot be driven ({error}): change its scenario"
            ) from error


def _check_place(scenario: Scenario) -> None:
    weather(scenario.weather)
    roads = load_town(scenario.town)
    route = plan_route(roads, scenario.start, scenario.goal)
    free_places(roads, scenario.n_vehicles, route.line.pose_at(0.0))
    require_room(roads, scenario.n_pedestrians)


def _benchmark(
    settings: BenchmarkSettings, driver: DriverSettings, trials: list[Trial], ours: dict[str, Any]
) -> Iterator[tuple[int, int, bool]]:
    for record in driven_elsewhere(settings.known, _missing(settings, trials), read_run(settings.out)):
        _keep(settings.out, record, ours)
    missing = _missing(settings, trials)
    done = len(trials) - len(missing)
    for _, record in _workers(settings, partial(drive_trial, driver), missing):
        _keep(settings.out, record, ours)
        done += 1
        yield done, len(trials), record.line["result"]["outcome"] == "success"


def _missing(settings: BenchmarkSettings, trials: list[Trial]) -> list[Trial]:
    known = read_lines(settings.out / RESULTS)
    return [trial for trial in trials if trial.key not in known]


def _workers(
    settings: BenchmarkSettings, work: Callable[[Trial], TrialRecord], trials: list[Trial]
) -> Iterator[tuple[Trial, TrialRecord]]:
    """The trials as they are done, by processes of this machine or by Ray's."""
    if settings.ray is None:
        return spread(work, trials, settings.workers)
    return spread_over_cluster(work, trials, settings.workers, settings.ray)


def _keep(folder: Path, record: TrialRecord, ours: dict[str, Any]) -> None:
    """Writes an episode's files, and last its line. Raises ValueError where a worker drove with something else."""
    for name, value in ours.items():
        if record.provenance[name] != value:
            raise ValueError(
                f"found a worker with {name} {record.provenance[name]}, wanted {value}: "
                "install the same caldrive and model on machines of one kind"
            )
    for name, content in record.files.items():
        write_whole(folder / name, content)
    append(folder / RESULTS, record.line)
