"""What mattered in a search: each task's score over each parameter of its blocks, as one picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from caldrive.affordances import BY_NAME
from caldrive.search.run import TaskResult
from caldrive.search.space import DILATION, DROPOUT, LAYERS, LENGTH, NODES
from caldrive.search.studies import FinishedTrial

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Where a parameter's axis begins and ends; layers stand side by side.
AXES = {"layer": (-0.5, len(LAYERS) - 0.5), "nodes": NODES, "dropout": DROPOUT, "length": LENGTH, "dilation": DILATION}
MARGIN = 0.04  # of an axis, beyond its ends
WHOLE, PRUNED = "#3b6ea5", "none"


def draw_parameters(tasks: Sequence[TaskResult], shares: Mapping[str, Mapping[str, float]]) -> Figure:
    """A row a task, a column a parameter. shares: the parameters' importance by task, where it is known."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(3.2 * len(AXES), 2.4 * len(tasks)), layout="constrained")
    axes = figure.subplots(len(tasks), len(AXES), squeeze=False, sharey="row")
    for line, task in zip(axes, tasks, strict=True):
        for ax, name in zip(line, AXES, strict=True):
            _draw_trials(ax, name, task.trials)
            share = shares[task.task].get(name)
            ax.set_title(name if share is None else f"{name} ({share:.0%})", fontsize=9)
        spec = BY_NAME[task.task]
        line[0].set_ylabel(f"{spec.title}\n{'IoU' if spec.discrete else 'MAE / scale'}")
        if not spec.discrete:
            line[0].set_yscale("log")
    return figure


def _draw_trials(ax: Any, name: str, trials: Sequence[FinishedTrial]) -> None:
    """The trials' scores over one parameter; a block of one frame has no dilation."""
    for pruned in (True, False):
        shown = [trial for trial in trials if trial.pruned == pruned and (name != "dilation" or trial.block.temporal)]
        places = [_place(name, trial) for trial in shown]
        colours = {"facecolors": PRUNED if pruned else WHOLE, "edgecolors": WHOLE}
        ax.scatter(places, [trial.value for trial in shown], s=18, **colours)
    low, high = AXES[name]
    ax.set_xlim(low - MARGIN * (high - low), high + MARGIN * (high - low))
    if name == "layer":
        ax.set_xticks(range(len(LAYERS)), LAYERS)
    if name == "dilation":
        ax.set_xticks(range(DILATION[0], DILATION[1] + 1))
    ax.grid(alpha=0.3)


def _place(name: str, trial: FinishedTrial) -> float:
    value = getattr(trial.block, name)
    return float(LAYERS.index(value)) if name == "layer" else float(value)
