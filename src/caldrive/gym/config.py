"""What a gymnasium environment of caldrive is made from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from difflib import get_close_matches
from typing import Any, Literal

from caldrive.datatypes import CameraConfig
from caldrive.driving.rules import COLLISION, RULES
from caldrive.driving.tasks import TASKS, TIME_LIMITS
from caldrive.gym.rewards import PRESETS
from caldrive.results import InfractionKind
from caldrive.scenarios import require_to_learn_from


@dataclass(frozen=True)
class EnvConfig:
    """The settings of a `DrivingEnv`. Raises ValueError for one that cannot be."""

    towns: tuple[str, ...] = ("town01",)
    """An episode's town is one of them: town01, town02, random:SEED or an OpenDRIVE file."""
    weathers: tuple[int, ...] = (1, 3, 6, 8)
    """Its weather is one of them; 1 to 14."""
    tasks: tuple[str, ...] = ("navigation",)
    """Its task is one of them."""
    cars: int | None = None
    """Other cars; None takes the task's."""
    people: int | None = None
    """People; None takes the task's."""
    time_limit: str = "paper"
    """After which it is truncated: paper, code or nocrash."""
    observation: Literal["image", "affordances"] = "image"
    """Whether the agent sees an image, or the true affordances in its place; then nothing is drawn."""
    camera: CameraConfig = CameraConfig()
    """The camera of `image`, and of `render`."""
    action: Literal["continuous", "carla2017"] = "continuous"
    """Box(2): throttle or brake, and steering; or the nine actions of the paper's RL."""
    frame_skip: int = 1
    """Steps of 0.1 s for which an action holds."""
    reward: str = "roach"
    """A preset: carla2017 or roach."""
    weights: Mapping[str, float] = field(default_factory=dict)
    """Of the reward's terms, in place of the preset's."""
    ends: tuple[InfractionKind, ...] = (*COLLISION.values(), InfractionKind.SIDEWALK)
    """Infractions that terminate an episode."""
    leaves_route: bool = False
    """Whether it also terminates where the car is 2 m or more beside the centre line of its route (Toromanoff et al.
    2020), as on a wrong way nothing can be learnt of the right one."""
    rules: str = "strict"
    """What counts as an infraction: strict, corl2017 or nocrash."""

    held_out: bool = False
    """Whether it may have towns that only judge (town02, and generated ones from seed 9,000,000 on): to measure, not to
    learn."""

    def __post_init__(self) -> None:
        for town in () if self.held_out else self.towns:
            require_to_learn_from(town)
        require_one_of("reward", self.reward, PRESETS)
        require_one_of("rules", self.rules, RULES)
        require_one_of("time_limit", self.time_limit, TIME_LIMITS)
        require_one_of("observation", self.observation, ("image", "affordances"))
        require_one_of("action", self.action, ("continuous", "carla2017"))
        for task in self.tasks:
            require_one_of("tasks", task, TASKS)
        for name in self.weights:
            require_one_of("weights", name, PRESETS[self.reward].weights)
        if not (self.towns and self.weathers and self.tasks and self.frame_skip >= 1):
            raise ValueError("found no town, weather, task or step, wanted one of each at least: give some")


def configured(config: EnvConfig, changes: Mapping[str, Any]) -> EnvConfig:
    """The settings with some changed, by their names. Raises ValueError for a name that is none of them."""
    names = [field.name for field in fields(EnvConfig)]
    for name in changes:
        require_one_of("setting", name, names)
    return replace(config, **{name: _frozen(value) for name, value in changes.items()})


def _frozen(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


def require_one_of(what: str, value: str, allowed: Any) -> None:
    """Raises ValueError where a value is none of the allowed; the nearest of them is named."""
    if value not in allowed:
        near = get_close_matches(str(value), map(str, allowed), n=1, cutoff=0.0)
        raise ValueError(
            f"found {what} {value!r}, wanted one of {', '.join(map(str, allowed))}: did you mean {near[0]}?"
        )
