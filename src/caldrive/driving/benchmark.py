"""The runner: drives a suite with several workers, and can be killed at any moment.

Every episode is one line in results.jsonl, appended when it is done. What a trial gives depends on the trial and on
what drives only, so the lines of a run that was broken off ten times are those of an unbroken one, in another order.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

from caldrive.datatypes import Step
from caldrive.driving.behaviour import Behaviour
from caldrive.driving.cluster import spread_over_cluster
from caldrive.driving.drivers import model_path, set_up
from caldrive.driving.outputs import require_writable_folder
from caldrive.driving.pool import spread
from caldrive.driving.referee import Referee
from caldrive.driving.rollout import run_episode
from caldrive.driving.settings import BenchmarkSettings, DriverSettings
from caldrive.driving.suites import SUITES, Driven, Trial, suite
from caldrive.driving.trace import plain, result_from_values, result_values
from caldrive.driving.witness import Witness
from caldrive.files import write_whole

PACKAGE = Path(__file__).parents[1]
RESULTS, RUN = "results.jsonl", "run.json"


@lru_cache(maxsize=1)
def code_version() -> str:
    """Tells this code from any other: a digest of all sources and data of the package, its models left aside."""
    digest = hashlib.sha256()
    for path in sorted(PACKAGE.rglob("*")):
        if path.is_file() and path.suffix not in (".pyc", ".safetensors"):
            digest.update(str(path.relative_to(PACKAGE)).encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]


def _digest(path: Path | None) -> str | None:
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16] if path else None


def _machine() -> str:
    """The processor in words, and how many cores it has."""
    info = Path("/proc/cpuinfo").read_text() if Path("/proc/cpuinfo").is_file() else ""
    names = [line.partition(":")[2].strip() for line in info.splitlines() if line.startswith("model name")]
    return f"{names[0] if names else platform.processor() or platform.machine()}, {os.cpu_count()} cores"


def _identity(settings: BenchmarkSettings) -> dict[str, Any]:
    """What a folder's results depend on."""
    model = model_path(settings.model) if settings.agent == "cal" else None
    own = Path(settings.suite) if settings.suite not in SUITES else None
    return {
        "suite": settings.suite, "suite_content": _digest(own), "agent": settings.agent, "model": _digest(model),
        "cap": None if settings.signs else settings.cap, "preset": settings.preset,
        "time_limit": settings.time_limit, "seed": settings.seed, "code": code_version(),
    }  # fmt: skip


def _claim(settings: BenchmarkSettings) -> None:
    """Writes down whose results a folder holds. Raises ValueError where they are another's."""
    path, wanted = settings.out / RUN, _identity(settings)
    if not path.is_file():
        file = {
            "model_file": str(settings.model.resolve()) if settings.model else None,
            "began": datetime.now(UTC).isoformat(timespec="seconds"),
            "machine": _machine(), "workers": settings.workers,
        }  # fmt: skip
        write_whole(path, (json.dumps(wanted | file, indent=2) + "\n").encode())
        return
    found = read_run(settings.out)
    for name, value in wanted.items():
        if found.get(name) != value:
            raise ValueError(
                f"found in {settings.out} results with {name} {found.get(name)}, wanted {value}: give another --out"
            )


def read_run(folder: Path) -> dict[str, Any]:
    """What drove the results in a folder. Raises ValueError where there are none."""
    path = folder / RUN
    if not path.is_file():
        raise ValueError(f"found no {RUN} in {folder}, wanted a benchmark's folder: type caldrive benchmark --out DIR")
    try:
        return dict(json.loads(path.read_text()))
    except (ValueError, TypeError) as error:
        raise ValueError(f"found that {path} is damaged, wanted a run's description: give another --out") from error


def read_lines(path: Path) -> dict[str, dict[str, Any]]:
    """The lines of a results file by trial. One that was being written when the run was killed is no line."""
    lines = path.read_bytes().split(b"\n")[:-1] if path.is_file() else []
    try:
        found = [json.loads(line) for line in lines]
        return {str(one["key"]): one for one in found}
    except (ValueError, KeyError, TypeError) as error:
        raise ValueError(f"found a damaged line in {path} ({error}), wanted results: give another --out") from error


def _append(path: Path, values: dict[str, Any]) -> None:
    """One more line, on the disk when this returns. Cuts off the rest of a line that was broken off."""
    with path.open("ab+") as file:
        file.seek(0)
        file.truncate(file.read().rfind(b"\n") + 1)
        file.write(json.dumps(values, separators=(",", ":"), allow_nan=False).encode() + b"\n")
        file.flush()
        os.fsync(file.fileno())


@lru_cache(maxsize=1)
def _set_up(driver: DriverSettings) -> Any:
    """One world and agent for each process."""
    return set_up(driver)


@dataclass(frozen=True)
class Drive:
    """What a worker sends back of a trial: its line, its files by their names, and the version of the code it ran."""

    line: dict[str, Any]
    files: dict[str, bytes]
    code: str


def drive_trial(driver: DriverSettings, trial: Trial) -> Drive:
    """Drives one trial."""
    world, agent = _set_up(driver)
    referee = Referee(trial.scenario, trial.fatal)
    behaviour, witness = Behaviour(), Witness(world, referee)

    def watch(step: Step) -> None:
        behaviour.add(step)
        witness.add(step)

    result = run_episode(world, agent, trial.scenario, watch, referee)
    figures = {name: plain(value) for name, value in behaviour.figures(result.infractions).items()}
    line = {"key": trial.key, "result": result_values(result), "figures": figures}
    return Drive(line, witness.files(trial.key, result), code_version())


def read_results(settings: BenchmarkSettings) -> list[Driven]:
    """What a folder holds of a suite, in the suite's order."""
    lines = read_lines(settings.out / RESULTS)
    trials = suite(settings.suite, settings.seed, settings.time_limit)
    return [
        Driven(trial, result_from_values(lines[trial.key]["result"]), lines[trial.key]["figures"])
        for trial in trials
        if trial.key in lines
    ]


def benchmark(settings: BenchmarkSettings) -> Iterator[tuple[int, int, bool]]:
    """Drives the trials that a folder lacks; yields how many are done, of how many, and whether the last one succeeded.

    Raises ValueError where the folder belongs to another run, RuntimeError where workers keep dying or Ray is missing.
    """
    if settings.workers < 1:
        raise ValueError(f"found --workers {settings.workers}, wanted 1 or more: type --workers 2")
    trials = suite(settings.suite, settings.seed, settings.time_limit)
    cap = None if settings.signs else settings.cap
    driver = DriverSettings(agent=settings.agent, model=settings.model, preset=settings.preset, cap=cap)
    require_writable_folder(settings.out)
    _claim(settings)
    known = read_lines(settings.out / RESULTS)
    missing = [trial for trial in trials if trial.key not in known]
    done = len(trials) - len(missing)
    for _, drive in _workers(settings, partial(drive_trial, driver), missing):
        _keep(settings.out, drive)
        done += 1
        yield done, len(trials), drive.line["result"]["outcome"] == "success"


def _workers(
    settings: BenchmarkSettings, work: Callable[[Trial], Drive], trials: list[Trial]
) -> Iterator[tuple[Trial, Drive]]:
    """The trials as they are done, by processes of this machine or by Ray's."""
    if settings.ray is None:
        return spread(work, trials, settings.workers)
    return spread_over_cluster(work, trials, settings.workers, settings.ray)


def _keep(folder: Path, drive: Drive) -> None:
    """Writes an episode's files, and last its line. Raises ValueError where a worker ran other code."""
    if drive.code != code_version():
        raise ValueError(
            f"found a worker with code {drive.code}, wanted {code_version()}: install the same caldrive on all machines"
        )
    for name, content in drive.files.items():
        write_whole(folder / name, content)
    _append(folder / RESULTS, drive.line)
