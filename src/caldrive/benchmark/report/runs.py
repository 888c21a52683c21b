"""What a report is made of: the runs in some benchmark folders, and the episodes in them that went wrong."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from caldrive.benchmark.evidence import read_trace
from caldrive.benchmark.failure_causes import Cause, cause
from caldrive.benchmark.run_folder import RunFolder
from caldrive.benchmark.settings import BenchmarkSettings
from caldrive.benchmark.suites import Driven
from caldrive.plugins import short_name
from caldrive.results import Outcome

UNITS = {"vehicle_distance": "m", "relative_angle": "rad", "center_distance": "m"}


@dataclass(frozen=True)
class BenchmarkRun:
    """One folder: its name in the report, its description, and its episodes."""

    name: str
    folder: Path
    about: dict[str, Any]
    driven: tuple[Driven, ...]

    def only(self, condition: str) -> list[Driven]:
        """The episodes of one condition."""
        return [one for one in self.driven if one.trial.condition == condition]

    @cached_property
    def failures(self) -> tuple[Failure, ...]:
        """The episodes that missed their goal or broke a rule, in the suite's order."""
        missed = (Outcome.TIMEOUT, Outcome.ABORTED)  # where an infraction ended the episode, it is the cause
        return tuple(
            Failure(
                self.name, one, tuple(_before(one, k) for k in range(len(one.result.infractions))),
                _cause(self.folder, one) if one.result.outcome in missed else None,
            )
            for one in self.driven
            if one.result.outcome is not Outcome.SUCCESS or any(i.at_fault for i in one.result.infractions)
        )  # fmt: skip

    @property
    def command(self) -> str:
        """What to type for these results."""
        about, usual = self.about, BenchmarkSettings()
        words = [f"caldrive benchmark --suite {about['suite']} --agent {about['agent']}"]
        words.append("--signs" if about["cap"] is None else f"--cap {about['cap']:g}")
        given = {"--controller": "controller", "--time-limit": "time_limit", "--seed": "seed"}
        words += [f"{word} {about[name]}" for word, name in given.items() if about[name] != getattr(usual, name)]
        words += [f"--model {about['model_file']}"] if about.get("model_file") else []
        return " ".join([*words, "--out DIR"])


def load_run(path: Path) -> BenchmarkRun:
    """Reads a benchmark's folder. Raises ValueError where there is none, or nothing in it."""
    folder = RunFolder(path)
    driven = folder.driven()
    if not driven:
        raise ValueError(f"found no episode in {path}, wanted some: type caldrive benchmark --out {path}")
    if not all("turning" in one.result.comfort and "reds_obeyed" in one.figures for one in driven):
        raise ValueError(f"found results of an older caldrive in {path}: type caldrive benchmark --out ANOTHER")
    return BenchmarkRun(short_name(folder.about["agent"]), path, folder.about, tuple(driven))


def load_runs(folders: Sequence[Path]) -> list[BenchmarkRun]:
    """All folders; runs of one agent are told apart by their folders. Raises ValueError for one that is given twice."""
    if len({folder.resolve() for folder in folders}) < len(folders):
        raise ValueError("found a folder twice, wanted each once: leave one of them out")
    runs = [load_run(folder) for folder in folders]
    names = [run.name for run in runs]
    return [
        replace(run, name=f"{run.name} ({_apart(run.folder, folders)})") if names.count(run.name) > 1 else run
        for run in runs
    ]


def _apart(folder: Path, folders: Sequence[Path]) -> str:
    """As much of a folder's path, from its end, as no other has."""
    ends = [other.resolve().parts for other in folders if other.resolve() != folder.resolve()]
    own = folder.resolve().parts
    length = next(n for n in range(1, len(own) + 1) if all(end[-n:] != own[-n:] for end in ends))
    return "/".join(own[-length:])


def conditions(runs: Sequence[BenchmarkRun]) -> list[str]:
    """All conditions in the order in which they first appear."""
    return list(dict.fromkeys(one.trial.condition for run in runs for one in run.driven))


@dataclass(frozen=True)
class Failure:
    """An episode that missed its goal or broke a rule. before: for each infraction what was wrong in the seconds
    before it; cause: how a missed goal began, where that is known."""

    run: str
    episode: Driven
    before: tuple[str, ...]
    cause: Cause | None = None


def failures(runs: Sequence[BenchmarkRun]) -> list[Failure]:
    """Those of all runs."""
    return [one for run in runs for one in run.failures]


def _cause(folder: Path, one: Driven) -> Cause | None:
    trace = read_trace(folder, one.trial.key)
    return cause(trace) if trace else None


def _before(one: Driven, k: int) -> str:
    """The affordances that were off in the seconds before infraction k."""
    found = {n.split("/")[2]: v for n, v in one.figures.items() if n.startswith(f"before/{k}/") and v is not None}
    if not found:
        return "not known"
    limits = {"vehicle_distance": 3.0, "relative_angle": 0.1, "center_distance": 0.3}
    wrong = [f"{n.replace('_', ' ')} {v:.2f} {UNITS[n]}" for n, v in found.items() if n in UNITS and v > limits[n]]
    wrong += [f"{n.replace('_', ' ')} {100 * v:.0f} %" for n, v in found.items() if n not in UNITS and v > 0.2]
    return ", ".join(wrong) or "nothing"
