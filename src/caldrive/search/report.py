"""What a search found, as a page (Markdown) with a picture, and as settings that `caldrive train` takes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from statistics import median
from typing import Any

from caldrive.affordances import BY_NAME
from caldrive.files import write_figure, write_whole
from caldrive.formats import markdown_table, toml
from caldrive.perception.network.config import BlockConfig
from caldrive.search.best import Retrained
from caldrive.search.config import SearchConfig
from caldrive.search.examples import HISTORY, Source
from caldrive.search.pictures import draw_parameters
from caldrive.search.run import SearchResult, TaskResult
from caldrive.search.space import PUBLISHED, PUBLISHED_TEMPORAL
from caldrive.search.studies import importances

PAGE, PICTURE, BLOCKS = "report.md", "parameters.png", "blocks.toml"
PARAMETERS = ("type", "nodes", "dropout", "frames", "every n-th")  # of a block


def write_report(findings: SearchResult, source: Source, config: SearchConfig) -> Path:
    """Writes report.md, parameters.png and blocks.toml into the search's folder; returns the page's path."""
    shares = {task.task: importances(source, config, task.task) for task in findings.tasks}
    write_figure(source.out / PICTURE, draw_parameters(findings.tasks, shares))
    write_whole(source.out / BLOCKS, blocks_toml(findings).encode())
    page = source.out / PAGE
    write_whole(page, "\n\n".join(_sections(findings, config)).encode() + b"\n")
    return page


def printed(task: str, value: float) -> str:
    """A score as the supplement prints it: percent of IoU, or MAE in units of the scale."""
    return f"{100 * value:.2f} %" if BY_NAME[task].discrete else f"{value:.5f}"


def change(before: float, after: float) -> str:
    """Relative change."""
    return f"{100 * (after - before) / before:+.1f} %" if before else "-"


def _sections(findings: SearchResult, config: SearchConfig) -> Iterable[str]:
    yield "# Search for task blocks"
    yield _about(findings, config)
    yield "## The best blocks, beside the supplement's"
    yield _best_blocks(findings)
    yield (
        f"The best {config.best} trials of each task with history, and as many without, trained again with "
        f"{config.seeds} seeds, on all frames that are compared; mean and standard deviation. The score in the search "
        "is that of the best of many trials, on fewer frames: it flatters."
    )
    yield _trained_again(findings)
    yield "## With and without history"
    yield _temporal(findings)
    yield "## The network of the best blocks"
    yield (
        f"All blocks trained jointly, {config.joint_steps} steps, on the features of the backbone as it is. Those of "
        "the network before learnt from augmented images, and longer."
    )
    yield _joint(findings)
    if conditioned := [task for task in findings.tasks if task.conditioned]:
        yield "## Where the command comes in"
        yield _conditioning(conditioned)
    yield "## What mattered"
    yield (
        "Each dot is a trial, hollow where it was pruned. In brackets: the parameter's share of what decides whether a "
        "trial is among the best (PED-ANOVA)."
    )
    yield f"![Each task's score over each parameter]({PICTURE})"


def _about(findings: SearchResult, config: SearchConfig) -> str:
    trials = [trial for task in findings.tasks for trial in task.trials]
    pruned, seconds = sum(trial.pruned for trial in trials), [trial.seconds for trial in trials]
    return (
        f"{len(findings.tasks)} tasks, {config.trials} trials each ({config.sampler}) of {config.steps} steps of "
        f"{config.batch} frames; {pruned} of {len(trials)} were pruned. A trial took {median(seconds):.0f} s in one "
        f"thread (median), all of them {sum(seconds) / 3600:.1f} h. Blocks learn from {findings.frames[0]} frames of "
        f"{findings.episodes[0]} episodes and are compared on {findings.frames[1]} frames of {findings.episodes[1]} "
        f"whole episodes that were held out; the first {HISTORY} frames of each episode are history only, for all "
        "blocks. IoU is the mean over the classes, MAE is in units of the affordance's scale."
    )


def _parameters(block: BlockConfig) -> list[str]:
    return [block.layer, str(block.nodes), f"{block.dropout:.2f}", str(block.length), str(block.dilation)]


def _best_blocks(findings: SearchResult) -> str:
    head = ["task", *PARAMETERS, *(f"{name}, paper" for name in PARAMETERS)]
    rows = (
        [BY_NAME[task.task].title, *_parameters(task.best.block), *_parameters(getattr(PUBLISHED, task.task))]
        for task in findings.tasks
    )
    return markdown_table(head, rows)


def _trained_again(findings: SearchResult) -> str:
    head = ("task", "trial", *PARAMETERS, "in the search", "again")
    rows = (
        [
            BY_NAME[task.task].title,
            str(block.draw),
            *_parameters(block.block),
            _searched(task, block),
            _again(task, block),
        ]
        for task in findings.tasks
        for block in task.retrained
    )
    return markdown_table(head, rows)


def _searched(task: TaskResult, block: Retrained) -> str:
    trial = next(trial for trial in task.trials if trial.draw == block.draw)
    return printed(task.task, trial.value) + (" (pruned)" if trial.pruned else "")


def _again(task: TaskResult, block: Retrained) -> str:
    return f"{printed(task.task, block.mean)} ± {printed(task.task, block.spread)}"


def _temporal(findings: SearchResult) -> str:
    head = (
        "task", "metric", "without", "with history", "change", "without, paper", "with, paper", "change, paper",
    )  # fmt: skip
    rows = []
    for task in findings.tasks:
        single, temporal = (task.best_of_kind(temporal=kind) for kind in (False, True))
        ours = ["-" if block is None else printed(task.task, block.mean) for block in (single, temporal)]
        ours.append("-" if single is None or temporal is None else change(single.mean, temporal.mean))
        paper = PUBLISHED_TEMPORAL[task.task]
        theirs = [*(printed(task.task, value) for value in paper), change(*paper)]
        rows.append([BY_NAME[task.task].title, "IoU" if BY_NAME[task.task].discrete else "MAE", *ours, *theirs])
    return markdown_table(head, rows)


def _joint(findings: SearchResult) -> str:
    joint = findings.networks["groups"].scores
    rows = ([BY_NAME[name].title, printed(name, findings.before[name]), printed(name, joint[name])] for name in joint)
    return markdown_table(("task", "the network before", "the best blocks"), rows)


def _conditioning(tasks: Sequence[TaskResult]) -> str:
    kinds = [block.block.conditioning for block in tasks[0].conditioned]
    rows = ([BY_NAME[task.task].title, *(_again(task, block) for block in task.conditioned)] for task in tasks)
    return markdown_table(("task", *kinds), rows)


def result_values(findings: SearchResult, page: Path) -> dict[str, Any]:
    """For --json."""
    tasks = {
        task.task: {
            "trials": len(task.trials),
            "pruned": sum(trial.pruned for trial in task.trials),
            "block": asdict(task.best.block),
            "score": task.best.mean,
            "spread": task.best.spread,
        }
        for task in findings.tasks
    }
    networks = {
        kind: {"model": str(network.path), "scores": network.scores} for kind, network in findings.networks.items()
    }
    return {"report": str(page), "tasks": tasks, "before": findings.before, "networks": networks}


def blocks_toml(findings: SearchResult) -> str:
    """The best blocks as settings, for `caldrive train --config`."""
    return toml({"network": {task.task: asdict(task.best.block) for task in findings.tasks}})
