"""Settings of a search for task blocks, with their limits. No import here waits for torch, Optuna or numpy."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Literal, get_args

from caldrive.checks import MOST_SEED, Limits, require_limits

Task = Literal["hazard_stop", "red_light", "speed_sign", "vehicle_distance", "relative_angle", "center_distance"]
TASKS: tuple[Task, ...] = get_args(Task)
CONDITIONAL_TASKS: tuple[Task, ...] = ("relative_angle", "center_distance")  # whose blocks are told the command

LIMITS: Limits = {
    "trials": (1, 100_000),
    "steps": (1, 10_000_000),
    "batch": (1, 100_000),
    "learning_rate": (1e-9, 1.0),
    "evaluations": (1, 1000),
    "validation_frames": (1, 10_000_000),
    "validation_share": (0.0, 0.9),
    "best": (1, 100),
    "seeds": (1, 100),
    "joint_steps": (1, 10_000_000),
    "seed": (0, MOST_SEED),
}
# Settings that may change while a search is under way: no trial depends on them.
FREE = ("trials", "tasks", "best", "seeds", "joint_steps", "conditioning")


@dataclass(frozen=True)
class SearchConfig:
    """A search in two steps (section 3.1): trials of random blocks, then the best of each task in one network."""

    trials: int = 40
    """Trials of each task. More of them go on with a search that is finished."""
    tasks: tuple[Task, ...] = TASKS
    """The affordances whose blocks are sought; the others keep the network's."""
    sampler: Literal["random", "tpe"] = "random"
    """random: as in the paper, the same draw for all tasks; tpe: a tree-structured Parzen estimator, which learns from
    earlier trials of a task."""
    steps: int = 800
    """Steps of a trial, and of each training of the best blocks."""
    batch: int = 128
    """Frames, with their history, a step."""
    learning_rate: float = 1e-3
    """Base learning rate."""
    evaluations: int = 5
    """How often a trial is measured. From the second time on it is pruned where its best so far is worse than the
    median of the whole trials then; blocks of one frame are quick, and are not."""
    validation_frames: int = 6000
    """Frames that a trial is measured on, spread evenly over the held-out episodes."""
    validation_share: float = 0.0
    """Share of the episodes that is held out, for a recording that the network has not learnt from. 0: those that its
    training held out."""
    best: int = 3
    """Blocks of each task, with history and without, that are trained again with other seeds: of many trials the best
    was lucky, too."""
    seeds: int = 3
    """Seeds with which each of them is trained."""
    joint_steps: int = 3000
    """Steps of the network of the best blocks."""
    conditioning: bool = False
    """Also compare three ways to tell a block the command (supplement 1.3): groups of nodes, an input, and a choice
    among the values for all commands. Each gives a network that drives."""
    seed: int = 0
    """Decides everything random."""

    def __post_init__(self) -> None:
        usual = {field.name: field.default for field in fields(self)}
        require_limits(vars(self), LIMITS, usual)
        unknown = [task for task in self.tasks if task not in TASKS]
        if unknown or not self.tasks or len(set(self.tasks)) < len(self.tasks):
            found = unknown[0] if unknown else " ".join(self.tasks) or "none"
            raise ValueError(f"found --tasks {found}, wanted some of {', '.join(TASKS)}: type --tasks hazard_stop")
        if self.conditioning and not set(self.tasks) & set(CONDITIONAL_TASKS):
            raise ValueError(
                f"found --conditioning with --tasks {' '.join(self.tasks)}, whose blocks are not told the command, "
                f"wanted {' or '.join(CONDITIONAL_TASKS)} among them: leave --conditioning out"
            )

    def decisive(self) -> dict[str, Any]:
        """The settings on which a trial depends."""
        return {name: value for name, value in vars(self).items() if name not in FREE}
