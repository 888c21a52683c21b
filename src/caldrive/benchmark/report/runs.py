"""What a report is made of: the runs in some benchmark folders, and the episodes in them that went wrong."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from caldrive.affordances import BY_NAME, CONTINUOUS, DISCRETE
from caldrive.benchmark.artifacts import read_trace
from caldrive.benchmark.failure_causes import FailureCause, failure_cause
from caldrive.benchmark.metrics import Cell, cells, is_clean
from caldrive.benchmark.run_folder import RunFolder
from caldrive.benchmark.settings import BenchmarkSettings
from caldrive.benchmark.suites import TrialResult
from caldrive.driving.comfort import FRAME_METRICS, METRICS
from caldrive.plugins import short_name
from caldrive.results import WITHOUT_END

LARGE_ERRORS = {  # before an infraction, from which an affordance is named: share of steps, or SI units
    "hazard_stop": 0.2, "red_light": 0.2, "speed_sign": 0.2, "vehicle_distance": 3.0, "relative_angle": 0.1,
    "center_distance": 0.3,
}  # fmt: skip
SENSES = {"blind": "blind to", "truth": "told"}  # options that take affordances, and what a driver with them is
OPTIONS = {"--controller": "controller", "--time-limit": "time_limit", "--seed": "seed"}  # of a command, if not usual


@dataclass(frozen=True)
class FailureMoment:
    """What the car saw at a moment of a failure."""

    title: str
    """Which moment it is."""
    text: str
    """What was seen and what was true, empty where the agent gives no affordances."""
    still: bytes
    """What the camera saw, as JPEG."""
    attention: bytes | None = None
    """The same with what the network looked at, where it is known."""


@dataclass(frozen=True)
class Explanation:
    """What is known of why an episode failed; `caldrive.explain` finds it out."""

    blame: str = ""
    """What the failure comes from, in words."""
    counted: str = ""
    """The one name under which it is counted."""
    blamed: tuple[str, ...] = ()
    """The same as names: the truth of each of them rescues the episode."""
    alone: tuple[str, ...] = ()
    """The affordances that spoil the episode when they alone are seen."""
    moments: tuple[FailureMoment, ...] = ()
    """How it came to it, the last one where it happens."""
    note: str = ""
    """What there is to say about these moments."""


@dataclass(frozen=True)
class BenchmarkRun:
    """One run's folder."""

    name: str
    """Its name in the report, which no other run has."""
    folder: Path
    """Where it lies."""
    description: dict[str, Any]
    """What its run.json says, a `RunDescription`."""
    results: tuple[TrialResult, ...]
    """Its episodes, in the suite's order."""
    problems: tuple[str, ...] = ()
    """What a reader should know: unfinished, edited or damaged, a sentence each."""
    explanations: Mapping[str, Explanation] = field(default_factory=dict)
    """Why episodes failed, by their keys, as far as it is known."""

    @property
    def notes_touches(self) -> bool:
        """Whether its lines say what was touched: those of before behaviour had a version do not."""
        return str(self.description["code"]).startswith("behaviour-")

    def of_condition(self, condition: str) -> list[TrialResult]:
        """The episodes of one condition."""
        return [result for result in self.results if result.trial.condition == condition]

    @cached_property
    def failures(self) -> tuple[Failure, ...]:
        """The episodes that missed their goal or broke a rule, in the suite's order."""
        return tuple(self._failure(result) for result in self.results if not is_clean(result))

    def _failure(self, result: TrialResult) -> Failure:
        errors = tuple(_errors_before(result, k) for k in range(len(result.episode.infractions)))
        # Where an infraction ended the episode, it is the cause.
        missed = result.episode.outcome in WITHOUT_END
        trace = read_trace(self.folder, result.trial.key) if missed else None
        cause = failure_cause(trace) if trace else None
        why = self.explanations.get(result.trial.key, Explanation())
        return Failure(run=self.name, result=result, errors_before=errors, cause=cause, explanation=why)

    @property
    def command(self) -> str:
        """What to type for these results."""
        about, usual = self.description, BenchmarkSettings()
        words = ["caldrive", "benchmark", "--suite", about["suite"], "--agent", about["agent"]]
        words += ["--signs"] if about["cap"] is None else ["--cap", f"{about['cap']:g}"]
        for option, name in OPTIONS.items():
            words += [option, str(about[name])] if about[name] != getattr(usual, name) else []
        words += [word for option in SENSES for name in about.get(option) or () for word in (f"--{option}", name)]
        words += ["--variant", about["variant"]] if about.get("variant") else []
        words += ["--model", about["model_file"]] if about.get("model_file") else []
        return shlex.join([*words, "--out", "DIR"])


@dataclass(frozen=True)
class Table:
    """A table of the report."""

    title: str
    text: str
    """A sentence on it."""
    head: tuple[str, ...]
    """The names of its columns."""
    rows: tuple[tuple[str, ...], ...]
    """Each as long as the head."""


@dataclass(frozen=True)
class Failure:
    """An episode that missed its goal or broke a rule."""

    run: str
    """The run's name."""
    result: TrialResult
    """What was driven, and how it went."""
    errors_before: tuple[str, ...]
    """For each infraction, which affordances were wrong in the seconds before it, in words."""
    cause: FailureCause | None = None
    """How a missed goal began, where that is known."""
    explanation: Explanation = Explanation()
    """Why it happened, as far as it is known."""


def load_run(path: Path) -> BenchmarkRun:
    """Reads a run's folder. Raises ValueError where there is none, or nothing in it."""
    folder = RunFolder(path)
    results = folder.results()
    if not results:
        raise ValueError(f"found no episode in {path}, wanted some: type caldrive benchmark --out {path}")
    whole = tuple(result for result in results if _is_whole(result))
    if not whole:
        raise ValueError(f"found results of an older caldrive in {path}: type caldrive benchmark --out ANOTHER")
    problems = folder.problems()
    if len(whole) < len(results):
        lacking = next(result.trial.key for result in results if not _is_whole(result))
        problems.append(f"lines that lack figures and are left out: {len(results) - len(whole)}, such as {lacking}")
    about = folder.description
    name = " ".join([short_name(about["agent"]), *filter(None, [about.get("variant")]), *_senses(about)])
    return BenchmarkRun(
        name=name, folder=path, description=folder.description, results=whole, problems=tuple(problems)
    )  # fmt: skip


def _senses(description: dict[str, Any]) -> list[str]:
    """What a driver did not see, and what it was told, in words."""
    words = list[str]()
    for option, said in SENSES.items():
        titles = [BY_NAME[name].title if name in BY_NAME else name for name in description.get(option) or ()]
        words += [said, " and ".join(titles)] if titles else []
    return words


def _is_whole(result: TrialResult) -> bool:
    """Whether a result has all the figures that the report's tables are made of."""
    return result.episode.comfort.keys() >= set(METRICS) - set(FRAME_METRICS) and "reds_obeyed" in result.metrics


def load_runs(folders: Sequence[Path]) -> list[BenchmarkRun]:
    """All folders; runs of one agent are told apart by their folders. Raises ValueError for one that is given twice."""
    if len({folder.resolve() for folder in folders}) < len(folders):
        raise ValueError("found a folder twice, wanted each once: leave one of them out")
    runs = [load_run(folder) for folder in folders]
    names = [run.name for run in runs]
    return [
        replace(run, name=f"{run.name} ({_unique_end(run.folder, folders)})") if names.count(run.name) > 1 else run
        for run in runs
    ]


def _unique_end(folder: Path, folders: Sequence[Path]) -> str:
    """As much of a folder's path, from its end, as no other has."""
    others = [other.resolve().parts for other in folders if other.resolve() != folder.resolve()]
    parts = folder.resolve().parts
    length = next(n for n in range(1, len(parts) + 1) if all(other[-n:] != parts[-n:] for other in others))
    return "/".join(parts[-length:])


def suites(runs: Sequence[BenchmarkRun]) -> set[str]:
    """That the runs are of."""
    return {run.description["suite"] for run in runs}


def conditions(runs: Sequence[BenchmarkRun]) -> list[str]:
    """All conditions in the order in which they first appear."""
    return list(dict.fromkeys(result.trial.condition for run in runs for result in run.results))


def cells_by_place(runs: Sequence[BenchmarkRun]) -> dict[tuple[str, str, str], Cell]:
    """The cells of all runs, by the run's name, condition and task."""
    return {(run.name, cell.condition, cell.task): cell for run in runs for cell in cells(run.results)}


def failures(runs: Sequence[BenchmarkRun]) -> list[Failure]:
    """Those of all runs."""
    return [failure for run in runs for failure in run.failures]


def _errors_before(result: TrialResult, k: int) -> str:
    """The affordances that were wrong in the seconds before infraction k, in words."""
    means = {spec: result.metrics.get(f"before/{k}/{spec.name}") for spec in (*CONTINUOUS, *DISCRETE)}
    known = {spec: mean for spec, mean in means.items() if mean is not None}
    if not known:
        return "not known"
    wrong = (
        f"{spec.title} {100 * mean:.0f} %" if spec.discrete else f"{spec.title} {mean:.2f} {spec.unit}"
        for spec, mean in known.items()
        if mean > LARGE_ERRORS[spec.name]
    )
    return ", ".join(wrong) or "nothing"
