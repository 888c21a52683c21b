"""Episodes that another suite has driven already. NoCrash's empty and regular towns are the paper's navigation tasks,
and a trial of the traffic school is one of NoCrash's that more infractions end."""

from __future__ import annotations

import gzip
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from caldrive.benchmark.evidence import episode_values, still_paths, trace_path
from caldrive.benchmark.run_folder import EpisodeRecord, RunFolder
from caldrive.benchmark.suites import Trial
from caldrive.files import json_line
from caldrive.results import EpisodeResult, Outcome, result_from_values
from caldrive.scenarios import Scenario

DRIVEN_BY = ("agent", "agent_source", "controller", "controller_source", "cap", "code", "model", "precision")


def driven_elsewhere(
    folders: Sequence[RunFolder], trials: Sequence[Trial], wanted: dict[str, Any]
) -> Iterator[EpisodeRecord]:
    """What driving would give, of those trials that are in other benchmarks' folders under any name.

    wanted: what the folders' runs must have been driven by, at least `DRIVEN_BY`. Raises ValueError where they were
    driven by something else.
    """
    left = {_nameless(trial.scenario): trial for trial in trials}
    for folder in folders:
        for name in DRIVEN_BY:
            value = folder.about.get(name)
            if value != wanted.get(name):
                raise ValueError(
                    f"found in {folder.path} episodes with {name} {value}, wanted {wanted.get(name)}: "
                    "leave that --known out"
                )
        for line in folder.lines().values():
            result = result_from_values(line["result"])
            trial = left.get(_nameless(result.scenario))
            if trial and _ends_the_same(result, trial) and trace_path(folder.path, line["key"]).is_file():
                del left[_nameless(trial.scenario)]
                yield EpisodeRecord(_renamed(line, trial), _files(folder.path, line, trial), {})


def _nameless(scenario: Scenario) -> Scenario:
    """What an episode depends on: all but its task's name."""
    return replace(scenario, task="")


def _ends_the_same(result: EpisodeResult, trial: Trial) -> bool:
    """Whether the infractions that end the trial would have ended this episode where it ended."""
    fatal = [k for k, one in enumerate(result.infractions) if one.kind in trial.fatal]
    return fatal == ([len(result.infractions) - 1] if result.outcome is Outcome.FAILED else [])


def _renamed(line: dict[str, Any], trial: Trial) -> dict[str, Any]:
    return line | {"key": trial.key, "result": _with_task(line["result"], trial)}


def _with_task(result: dict[str, Any], trial: Trial) -> dict[str, Any]:
    return result | {"scenario": result["scenario"] | {"task": trial.scenario.task}}


def _files(folder: Path, line: dict[str, Any], trial: Trial) -> dict[str, bytes]:
    """The episode's trace and stills under their new names."""
    key = line["key"]
    values = episode_values(trace_path(folder, key)) | {"result": _with_task(line["result"], trial)}
    found = {str(trace_path(Path(), trial.key)): gzip.compress(json_line(values), mtime=0)}
    stills = enumerate(still_paths(folder, key))
    return found | {f"stills/{trial.key}-{k}.jpg": path.read_bytes() for k, path in stills}
