"""Counterfactuals over many episodes: how much each change changes, and what became of the paper's observations.

Each episode is driven, changed and asked by itself, and kept in a file: a study that was killed goes on, and several
processes share the episodes out.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from statistics import mean

from caldrive.checks import MOST_WORKERS, require_within, require_writable_folder
from caldrive.explain.cases import SITUATIONS
from caldrive.explain.counterfactual_episode import (
    EpisodeFindings,
    StudyConfig,
    episode_path,
    read_findings,
    study_episode,
)
from caldrive.explain.counterfactual_sheet import sheet
from caldrive.explain.counterfactuals import Effect, effects
from caldrive.explain.interventions import INTERVENTIONS
from caldrive.explain.observations import STATEMENTS, Finding, finding
from caldrive.files import claim_folder, locked_folder, write_whole
from caldrive.parallel.processes import parallel_map
from caldrive.progress import Progress, silent

SETTINGS, SHEET = "study.json", "sheet.png"  # files in a study's folder


@dataclass(frozen=True)
class DrivingGap:
    """How far the network at the wheel, in 8-bit integers, is from the one that is asked here."""

    cases: int
    other_answers: int
    difference: float
    """Mean, of probabilities."""


@dataclass(frozen=True)
class Study:
    """What was found."""

    found: Mapping[str, tuple[int, int]]
    """By situation, as in an episode."""
    effects: list[Effect]
    findings: list[Finding]
    gap: DrivingGap
    sheet: Path
    """A picture with an example of each change."""


def study(config: StudyConfig, out: Path, workers: int = 1, progress: Progress = silent) -> Study:
    """Drives the episodes that the folder `out` lacks, changes what is found there, and draws the sheet.

    Raises ValueError where the folder holds another study, RuntimeError where workers die again and again.
    """
    require_within("--workers", workers, 1, MOST_WORKERS, 2)
    require_writable_folder(out)
    with locked_folder(out):
        claim_folder(out / SETTINGS, config.decisive(), "a study")
        total = len(config.scenarios)
        missing = [k for k in range(total) if not episode_path(out, k).is_file()]
        before = total - len(missing)
        progress(f"counterfactuals, {before} of {total} episodes", before / total)
        for done, _ in enumerate(parallel_map(partial(study_episode, config, out), missing, workers), before + 1):
            progress(f"counterfactuals, {done} of {total} episodes", done / total)
        episodes = [read_findings(episode_path(out, k)) for k in range(total)]
        write_whole(out / SHEET, sheet(_rows(episodes)))
    return _summary(episodes, config.seed, out / SHEET)


def _rows(episodes: Sequence[EpisodeFindings]) -> list[bytes]:
    """The first example of each change."""
    examples = [
        next((one.rows[change.key] for one in episodes if change.key in one.rows), None) for change in INTERVENTIONS
    ]
    return [base64.b64decode(example) for example in examples if example is not None]


def _summary(episodes: Sequence[EpisodeFindings], seed: int, page: Path) -> Study:
    changes = [(k, change) for k, episode in enumerate(episodes) for change in episode.changes]
    said = [(k, text, value) for k, episode in enumerate(episodes) for text, value in episode.observations]
    values = {one.text: [(k, value) for k, text, value in said if text == one.text] for one in STATEMENTS}
    gaps = [gap for episode in episodes for gap in episode.gaps]
    differences = [difference for _, difference in gaps if difference is not None]
    counts = {one.name: [episode.found[one.name] for episode in episodes] for one in SITUATIONS}
    return Study(
        found={name: (sum(n for n, _ in pairs), sum(right for _, right in pairs)) for name, pairs in counts.items()},
        effects=effects(changes, seed),
        findings=[finding(statement, values[statement.text], seed) for statement in STATEMENTS],
        gap=DrivingGap(len(gaps), sum(other for other, _ in gaps), mean(differences) if differences else 0.0),
        sheet=page,
    )  # fmt: skip
