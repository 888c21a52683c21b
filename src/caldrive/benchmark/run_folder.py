"""A run's folder: what drove it (run.json), its episodes' lines (`result_lines`), traces and stills (`artifacts`).

A folder takes results of one agent, model, code and precision only.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path
from typing import Any, NotRequired, TypedDict

from caldrive.agents.registry import provenance
from caldrive.agents.settings import AgentSettings
from caldrive.benchmark.artifacts import read_trace_file, still_paths, trace_path
from caldrive.benchmark.result_lines import append_line, has_lines, make_appendable, read_lines
from caldrive.benchmark.settings import BenchmarkSettings
from caldrive.benchmark.suites import HERE, SUITES, Towns, Trial, TrialResult, from_json, suite
from caldrive.driving.settings import DriverSettings
from caldrive.files import read_json, write_whole
from caldrive.provenance import code_version, machine_name
from caldrive.results import result_from_values
from caldrive.scenarios import TOWNS, generated_town
from caldrive.world.roads.towns import load_roads

RUN = "run.json"


class RunDescription(TypedDict):
    """What run.json says.

    suite_content, agent_source, controller_source: digests of files of one's own. world: None for the embedded one;
    towns: the maps of another that stand for the suite's; host, port: where that was. model_file: the path of the
    network, where it is not the package's. began: the time in UTC."""

    suite: str
    suite_content: str | None
    agent: str
    agent_source: NotRequired[str | None]
    controller: str
    controller_source: NotRequired[str | None]
    cap: float | None
    blind: NotRequired[list[str] | None]
    truth: NotRequired[list[str] | None]
    variant: NotRequired[str | None]
    world: NotRequired[str | None]
    towns: NotRequired[dict[str, str] | None]
    host: NotRequired[str]
    port: NotRequired[int]
    time_limit: str
    seed: int
    code: str
    model: str | None
    precision: str | None
    model_file: str | None
    began: str
    machine: str
    workers: int


@dataclass(frozen=True)
class EpisodeRecord:
    """What is kept of a trial that was driven."""

    line: dict[str, Any]
    """A `ResultLine`."""
    files: dict[str, bytes]
    """Its artifacts by their names in the folder."""
    provenance: dict[str, Any]
    """What drove it, as `driver_provenance` says."""


def driver_provenance(driver: AgentSettings) -> dict[str, Any]:
    """What results depend on in the process that drives: code, network, precision, and files of one's own."""
    return {"code": code_version(), **provenance(driver)}


def suite_digest(path: Path, trials: Sequence[Trial]) -> str:
    """A digest of a suite of one's own: of its file, and of the maps and generated towns that its trials drive in."""
    maps = sorted({trial.scenario.town for trial in trials} - set(TOWNS))
    files = (load_roads(town).network if generated_town(town) else Path(town) for town in maps)
    content = b"".join(part.read_bytes() for part in (path, *files))
    return hashlib.sha256(content).hexdigest()[:16]


def run_identity(
    settings: BenchmarkSettings, trials: Sequence[Trial], driven_by: dict[str, Any], towns: Towns = HERE
) -> dict[str, Any]:
    """What a folder's results depend on. trials: the suite's; driven_by: the `driver_provenance` of this process;
    towns: see `suite`."""
    own_suite, driver = Path(settings.suite) if settings.suite not in SUITES else None, settings.driver
    return {
        "suite": str(own_suite.resolve()) if own_suite else settings.suite,
        "suite_content": suite_digest(own_suite, trials) if own_suite else None,
        "agent": driver.agent, "controller": driver.controller, "cap": driver.cap,
        "blind": list(driver.blind) or None, "truth": list(driver.truth) or None, "variant": driver.variant,
        "world": None if driver.world == "embedded" else driver.world, "towns": dict(towns) or None,
        "time_limit": settings.time_limit, "seed": settings.seed, **driven_by,
    }  # fmt: skip


class RunFolder:
    """A folder that has a run.json. description: what it says, a `RunDescription`."""

    def __init__(self, path: Path) -> None:
        """Raises ValueError where there is no run, or its description is damaged."""
        self.path = path
        self.description: dict[str, Any] = _read_description(path)

    @classmethod
    def claim(
        cls, settings: BenchmarkSettings, trials: list[Trial], driven_by: dict[str, Any], towns: Towns = HERE
    ) -> RunFolder:
        """The folder for settings' results, new or taken up again. trials: the suite's. Raises ValueError where it
        holds another run's."""
        path, identity = settings.out, run_identity(settings, trials, driven_by, towns)
        if not has_lines(path):  # what was tried here before, if anything, came to nothing
            _write_description(settings, identity)
        elif not (path / RUN).is_file():
            raise ValueError(f"found results in {path}, but no {RUN} that says whose: give another --out")
        folder = cls(path)
        folder.trials = trials
        for name, value in identity.items():
            if folder.description.get(name) != value:
                raise ValueError(
                    f"found in {path} results with {name} {folder.description.get(name)}, wanted {value}: "
                    "give another --out"
                )
        make_appendable(path)
        return folder

    @property
    def driver(self) -> DriverSettings:
        """Who drove, and in which world."""
        about = self.description
        return DriverSettings(
            agent=about["agent"], model=Path(about["model_file"]) if about["model_file"] else None,
            controller=about["controller"], cap=about["cap"], blind=tuple(about.get("blind") or ()),
            truth=tuple(about.get("truth") or ()), variant=about.get("variant"),
            world=about.get("world") or "embedded", **{name: about[name] for name in ("host", "port") if name in about},
        )  # fmt: skip

    @cached_property
    def trials(self) -> list[Trial]:
        """The suite's trials. Raises ValueError where the file of a suite of one's own is not what it was."""
        about = self.description
        if about["suite_content"] is not None:
            return _own_trials(Path(about["suite"]), about["suite_content"])
        return suite(about["suite"], about["seed"], about["time_limit"], about.get("towns") or HERE)

    def lines(self) -> dict[str, dict[str, Any]]:
        """The sound lines by trial, as `ResultLine`."""
        return read_lines(self.path).by_trial

    def problems(self) -> list[str]:
        """What a reader of these results should know: a sentence each on damaged lines, lines that are none of the
        suite's, changed results, and trials that are not driven yet."""
        lines, keys = read_lines(self.path), [trial.key for trial in self.trials]
        problems = [
            f"{sentence}: type caldrive benchmark as before, and it is driven again" for sentence in lines.damaged
        ]
        if foreign := sorted(lines.by_trial.keys() - set(keys)):
            problems.append(f"lines of no trial of {self.description['suite']}: {len(foreign)}, such as {foreign[0]}")
        changed = [key for key in keys if key in lines.by_trial and _changed(self.path, key, lines.by_trial[key])]
        if changed:
            problems.append(f"lines that say something else than their traces: {len(changed)}, such as {changed[0]}")
        done = sum(key in lines.by_trial for key in keys)
        if done < len(keys):
            problems.append(f"unfinished: {done} of {len(keys)} episodes are driven")
        return problems

    def missing(self) -> list[Trial]:
        """The trials that are not driven yet."""
        done = self.lines()
        return [trial for trial in self.trials if trial.key not in done]

    def results(self) -> list[TrialResult]:
        """The results, in the suite's order. Raises ValueError where a line is of an older suite's trial."""
        lines = self.lines()
        return [trial_result(trial, lines[trial.key]) for trial in self.trials if trial.key in lines]

    def save(self, record: EpisodeRecord) -> None:
        """Writes an episode's files, and last its line. Raises ValueError where a worker drove with something else."""
        for name, value in record.provenance.items():
            if self.description.get(name) != value:
                raise ValueError(
                    f"found a worker with {name} {value}, wanted {self.description.get(name)}: "
                    "install the same caldrive and model on machines of one kind"
                )
        for left_over in still_paths(self.path, record.line["key"]):  # of a run that was killed before its first line
            left_over.unlink()
        for name, content in record.files.items():
            write_whole(self.path / name, content)
        append_line(self.path, record.line)


def _write_description(settings: BenchmarkSettings, identity: dict[str, Any]) -> None:
    more = {
        "model_file": str(settings.model.resolve()) if settings.model else None,
        "began": datetime.now(UTC).isoformat(timespec="seconds"),
        "machine": machine_name(), "workers": settings.workers, **settings.address,
    }  # fmt: skip
    write_whole(settings.out / RUN, (json.dumps(identity | more, indent=2) + "\n").encode())


def _changed(folder: Path, key: str, line: dict[str, Any]) -> bool:
    """Whether a line was edited: its trace, where it is still there, holds the result, too."""
    path = trace_path(folder, key)
    return path.is_file() and read_trace_file(path).get("result") != line["result"]


def trial_result(trial: Trial, line: dict[str, Any]) -> TrialResult:
    """A trial and its line. Raises ValueError where the line is of an older suite's trial of this name."""
    result = result_from_values(line["result"])
    if result.scenario != trial.scenario:
        raise ValueError(
            f"found that {trial.key} was another episode when it was driven: type caldrive benchmark --out ANOTHER"
        )
    return TrialResult(trial=trial, episode=result, metrics=line["figures"])


def _read_description(folder: Path) -> dict[str, Any]:
    path = folder / RUN
    if not path.is_file():
        raise ValueError(f"found no {RUN} in {folder}, wanted a benchmark's folder: type caldrive benchmark --out DIR")
    try:
        return dict(read_json(path.read_bytes(), RunDescription))
    except ValueError as error:
        raise ValueError(
            f"found that {path} is damaged ({error}), wanted a run's description: type caldrive benchmark --out ANOTHER"
        ) from error


def _own_trials(path: Path, digest: str) -> list[Trial]:
    """The trials of a suite of one's own. Raises ValueError where its file, or a map, is not what it was."""
    try:
        trials = from_json(path)
        now = suite_digest(path, trials)
    except (ValueError, OSError) as error:
        now = str(error)
    if now != digest:
        raise ValueError(
            f"found that {path} or a map in it is not what was driven ({now}), wanted "
            f"{digest}: put it back, or type caldrive benchmark --out ANOTHER"
        )
    return trials
