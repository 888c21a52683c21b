"""Episodes that another suite has driven already are taken over: a trial of the traffic school is one of NoCrash's that
more infractions end, and a run of a suite's part is part of the whole one's."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from caldrive.benchmark.artifacts import artifact_files, read_still, read_trace_file, still_paths, trace_path
from caldrive.benchmark.run_folder import EpisodeRecord, RunFolder
from caldrive.benchmark.suites import Trial
from caldrive.files import json_line
from caldrive.results import EpisodeResult, Outcome, result_from_values
from caldrive.scenarios import Scenario

SAME = (
    "agent", "agent_source", "controller", "controller_source", "cap", "blind", "truth", "variant", "world", "code",
    "model", "precision",
)  # fmt: skip


def reusable_records(
    folders: Sequence[RunFolder], trials: Sequence[Trial], driven_by: dict[str, Any]
) -> Iterator[EpisodeRecord]:
    """What driving would give, of those trials that are in other runs' folders under any name.

    driven_by: what the folders' runs must have been driven by, at least `SAME`. Raises ValueError where they were
    driven by something else.
    """
    wanted = {_without_name(trial.scenario): trial for trial in trials}
    for folder in folders:
        _require_same_driver(folder, driven_by)
        for line in folder.lines().values():
            result = result_from_values(line["result"])
            trial = wanted.get(_without_name(result.scenario))
            if trial and _ends_the_same(result, trial) and trace_path(folder.path, line["key"]).is_file():
                del wanted[_without_name(trial.scenario)]
                renamed = line | {"key": trial.key, "result": _with_task(line["result"], trial)}
                yield EpisodeRecord(line=renamed, files=_files(folder.path, line, trial), provenance={})


def _require_same_driver(folder: RunFolder, driven_by: dict[str, Any]) -> None:
    for name in SAME:
        value = folder.description.get(name)
        if value != driven_by.get(name):
            raise ValueError(
                f"found in {folder.path} episodes with {name} {value}, wanted {driven_by.get(name)}: "
                "leave that --known out"
            )


def _without_name(scenario: Scenario) -> Scenario:
    """What an episode depends on: all but its task's name."""
    return replace(scenario, task="")


def _ends_the_same(result: EpisodeResult, trial: Trial) -> bool:
    """Whether the infractions that end the trial were counted, and would have ended this episode where it ended."""
    if result.rules != trial.rules:
        return False
    fatal = [k for k, infraction in enumerate(result.infractions) if infraction.kind in trial.fatal]
    return fatal == ([len(result.infractions) - 1] if result.outcome is Outcome.FAILED else [])


def _with_task(result: dict[str, Any], trial: Trial) -> dict[str, Any]:
    """A result's values under the trial's name of the task."""
    return result | {"scenario": result["scenario"] | {"task": trial.scenario.task}}


def _files(folder: Path, line: dict[str, Any], trial: Trial) -> dict[str, bytes]:
    """The episode's trace and stills under their new names."""
    key = line["key"]
    values = read_trace_file(trace_path(folder, key)) | {"result": _with_task(line["result"], trial)}
    return artifact_files(trial.key, json_line(values), [read_still(path) for path in still_paths(folder, key)])
