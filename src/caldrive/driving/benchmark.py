"""The runner: drives a suite with several workers, and can be killed at any moment.

What a trial gives depends on the trial and on what drives only, so the lines of a run that was broken off ten times are
those of an unbroken one, in another order.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

from caldrive.driving.cluster import spread_over_cluster
from caldrive.driving.drivers import controller_config
from caldrive.driving.ledger import RESULTS, append, claim, held, makings, read_lines, read_run
from caldrive.driving.outputs import require_writable_folder
from caldrive.driving.pool import spread
from caldrive.driving.reuse import driven_elsewhere
from caldrive.driving.settings import BenchmarkSettings, DriverSettings
from caldrive.driving.suites import SUITES, Driven, Trial, suite
from caldrive.driving.trace import result_from_values
from caldrive.driving.worker import Drive, drive_trial
from caldrive.files import write_whole


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
    model = settings.model.resolve() if settings.model else None  # workers elsewhere stand in other folders
    driver = DriverSettings(agent=settings.agent, model=model, preset=settings.preset, cap=settings.pace)
    require_writable_folder(settings.out)
    with held(settings.out):
        yield from _benchmark(settings, driver, trials)


def _check(settings: BenchmarkSettings) -> None:
    """Refuses what no benchmark can be made of before a folder is claimed."""
    if settings.workers < 1:
        raise ValueError(f"found --workers {settings.workers}, wanted 1 or more: type --workers 2")
    if settings.seed < 0:
        raise ValueError(f"found --seed {settings.seed}, wanted 0 or more: type --seed 0")
    if settings.suite not in SUITES and (settings.seed, settings.time_limit) != (0, "paper"):
        raise ValueError(
            f"found --seed or --time-limit with {settings.suite}, whose trials have their own: leave them out"
        )
    controller_config(settings.preset, settings.pace)


def _benchmark(
    settings: BenchmarkSettings, driver: DriverSettings, trials: list[Trial]
) -> Iterator[tuple[int, int, bool]]:
    claim(settings)
    ours = makings(driver)
    for drive in driven_elsewhere(settings.known, _missing(settings, trials), read_run(settings.out)):
        _keep(settings.out, drive, ours)
    missing = _missing(settings, trials)
    done = len(trials) - len(missing)
    for _, drive in _workers(settings, partial(drive_trial, driver), missing):
        _keep(settings.out, drive, ours)
        done += 1
        yield done, len(trials), drive.line["result"]["outcome"] == "success"


def _missing(settings: BenchmarkSettings, trials: list[Trial]) -> list[Trial]:
    known = read_lines(settings.out / RESULTS)
    return [trial for trial in trials if trial.key not in known]


def _workers(
    settings: BenchmarkSettings, work: Callable[[Trial], Drive], trials: list[Trial]
) -> Iterator[tuple[Trial, Drive]]:
    """The trials as they are done, by processes of this machine or by Ray's."""
    if settings.ray is None:
        return spread(work, trials, settings.workers)
    return spread_over_cluster(work, trials, settings.workers, settings.ray)


def _keep(folder: Path, drive: Drive, ours: dict[str, Any]) -> None:
    """Writes an episode's files, and last its line. Raises ValueError where a worker drove with something else."""
    for name, value in ours.items():
        if drive.makings[name] != value:
            raise ValueError(
                f"found a worker with {name} {drive.makings[name]}, wanted {value}: "
                "install the same caldrive and model on machines of one kind"
            )
    for name, content in drive.files.items():
        write_whole(folder / name, content)
    append(folder / RESULTS, drive.line)
