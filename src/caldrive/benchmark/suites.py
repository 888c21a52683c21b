"""Suites: plain lists of trials. Those of the field are made here, anyone's own can be read from a file.

The conditions are those of the paper's tables: the training town and weathers, new weathers, the new town, and both.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import Any, NotRequired, TypedDict

from caldrive.driving.tasks import ROUTES_PER_TASK, TASKS, USUAL_TRAFFIC, task_scenarios
from caldrive.files import read_json
from caldrive.results import EpisodeResult, InfractionKind
from caldrive.scenarios import Scenario, scenario_from_values, scenario_values

TRAINING_WEATHERS, NEW_WEATHERS = (1, 3, 6, 8), (4, 14)

CONDITIONS = {
    "training": ("town01", TRAINING_WEATHERS),
    "new weather": ("town01", NEW_WEATHERS),
    "new town": ("town02", TRAINING_WEATHERS),
    "new town + weather": ("town02", NEW_WEATHERS),
}
# NoCrash's tasks: cars and people in each town.
DENSITIES = {
    "empty": {"town01": (0, 0), "town02": (0, 0)},
    "regular": USUAL_TRAFFIC,
    "dense": {"town01": (100, 250), "town02": (70, 150)},
}
COLLISIONS = (InfractionKind.COLLISION_CAR, InfractionKind.COLLISION_OBJECT, InfractionKind.COLLISION_PERSON)

OFFENCES = (*COLLISIONS, InfractionKind.RED_LIGHT, InfractionKind.OPPOSITE_LANE, InfractionKind.SIDEWALK)

QUICK_ROUTES = 2
SUITES = ("corl2017", "corl2017-once", "nocrash", "traffic-school", "quick")


@dataclass(frozen=True)
class Trial:
    """One episode of a suite. key: its name, which no other trial has. condition: its column in the tables, the
    scenario's task is its row. fatal: infractions that end the episode as a failure."""

    key: str
    condition: str
    scenario: Scenario
    fatal: tuple[InfractionKind, ...] = ()


@dataclass(frozen=True)
class Driven:
    """A trial and how it went. figures: those of `Behaviour`, by name."""

    trial: Trial
    result: EpisodeResult
    figures: dict[str, Any]


def suite(name: str, seed: int = 0, time_limit: str = "paper") -> list[Trial]:
    """A suite by its name, or from a JSON file by `to_json`.

    time_limit: `paper` is the path at 10 km/h, `code` the authors' path at 5 km/h plus 10 s. Raises ValueError for an
    unknown name and a file that is no suite.
    """
    if name == "corl2017":
        return list(_corl2017(seed, time_limit, ROUTES_PER_TASK))
    if name == "corl2017-once":
        return _once(_corl2017(seed, time_limit, ROUTES_PER_TASK))
    if name == "quick":
        return [t for t in _corl2017(seed, time_limit, QUICK_ROUTES) if t.scenario.weather in (1, 14)]
    if name in ("nocrash", "traffic-school"):
        return list(_nocrash(seed, time_limit, COLLISIONS if name == "nocrash" else OFFENCES))
    if name.endswith(".json"):
        return from_json(Path(name))
    raise ValueError(f"found suite {name!r}, wanted {', '.join(SUITES)} or a .json file: type --suite quick")


def _by_weather() -> Iterator[tuple[str, str, int]]:
    """Condition, town and weather: each condition's first weather, then each one's second, and so on, so that a run
    broken off early has seen something of every cell."""
    rounds = zip_longest(*([(name, town, w) for w in weathers] for name, (town, weathers) in CONDITIONS.items()))
    yield from (one for each in rounds for one in each if one is not None)


def _seed(seed: int, weather: int) -> int:
    """Other traffic and other lights in each weather: a driver who does not look at the sky drives no episode twice."""
    return 100 * seed + weather


def _corl2017(seed: int, time_limit: str, routes: int) -> Iterator[Trial]:
    for condition, town, weather in _by_weather():
        for task in TASKS:
            found = task_scenarios(town, task, weather, seed=_seed(seed, weather), time_limit=time_limit)
            for k, scenario in enumerate(found[:routes]):
                yield Trial(f"{town}-w{weather:02d}-{task}-{k:02d}", condition, scenario)


def _route(trial: Trial) -> int:
    return int(trial.key.rpartition("-")[2])


def _once(trials: Iterator[Trial]) -> list[Trial]:
    """Each route of each cell in one of its weathers, which take turns; the first of each cell before the second."""

    def due(trial: Trial) -> bool:
        weathers = CONDITIONS[trial.condition][1]
        return trial.scenario.weather == weathers[_route(trial) % len(weathers)]

    return sorted(filter(due, trials), key=_route)


def _nocrash(seed: int, time_limit: str, fatal: tuple[InfractionKind, ...]) -> Iterator[Trial]:
    for condition, town, weather in _by_weather():
        for density, traffic in DENSITIES.items():
            cars, people = traffic[town]
            found = task_scenarios(
                town, "navigation", weather, cars=cars, people=people, seed=_seed(seed, weather), time_limit=time_limit,
                name=density,
            )  # fmt: skip
            for k, scenario in enumerate(found):
                yield Trial(f"{town}-w{weather:02d}-{density}-{k:02d}", condition, scenario, fatal)


def to_json(trials: list[Trial]) -> str:
    """A suite as JSON."""
    rows = [
        {
            "key": one.key, "condition": one.condition, "fatal": [kind.value for kind in one.fatal],
            "scenario": scenario_values(one.scenario),
        }
        for one in trials
    ]  # fmt: skip
    return json.dumps(rows, indent=1)


class _Row(TypedDict):
    """A trial as `to_json` writes it."""

    key: str
    condition: str
    scenario: dict[str, Any]
    fatal: NotRequired[tuple[InfractionKind, ...]]


def _key(value: str) -> str:
    """A trial's key, which names files."""
    if not re.fullmatch(r"\w[\w.-]{0,99}", value, re.ASCII):
        raise ValueError(f"found key {value!r}, wanted letters, digits, -, _ and .")
    return value


def from_json(path: Path) -> list[Trial]:
    """The inverse of `to_json`. Raises ValueError where the file is missing, holds something else, or a key twice."""
    if not path.is_file():
        raise ValueError(f"found no suite {path}, wanted a JSON file: look for the name, or type --suite quick")
    try:
        trials = [
            Trial(_key(row["key"]), row["condition"], scenario_from_values(row["scenario"]), row.get("fatal", ()))
            for row in read_json(path.read_bytes(), list[_Row])
        ]
    except ValueError as error:
        raise ValueError(
            f"found that {path} is no suite ({error}), wanted a list of key, condition, scenario: see suites.to_json"
        ) from error
    keys = [one.key for one in trials]
    if len(set(keys)) != len(keys) or not keys:
        raise ValueError(f"found no trial or a key twice in {path}, wanted each once: give every trial its own key")
    return trials
