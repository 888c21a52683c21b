"""Suites: plain lists of trials. Those of the field are made here, anyone's own can be read from a JSON file.

The conditions are those of the paper's tables: the training town and weathers, new weathers, the new town, and both.
CoRL-2017's new weathers are 4 and 14, NoCrash's 10 and 14 (driving-benchmarks, `corl_2017.py` and `carla100`).
Suites of generated towns have one condition each.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import zip_longest
from pathlib import Path
from typing import Any, NotRequired, TypedDict

from caldrive.benchmark.generated_suites import GENERATED_SUITES, generated_scenarios
from caldrive.driving.rules import RULES
from caldrive.driving.tasks import ROUTES_PER_TASK, TASKS, USUAL_TRAFFIC, task_scenarios
from caldrive.files import read_json
from caldrive.results import EpisodeResult, InfractionKind
from caldrive.scenarios import Scenario, scenario_from_values, scenario_values

TRAINING_WEATHERS, NEW_WEATHERS, NOCRASH_NEW_WEATHERS = (1, 3, 6, 8), (4, 14), (10, 14)
CONDITIONS = {  # town, and whether its weathers are those of the training
    "training": ("town01", True),
    "new weather": ("town01", False),
    "new town": ("town02", True),
    "new town + weather": ("town02", False),
}
DENSITIES = {  # NoCrash's tasks: cars and people in each town
    "empty": {"town01": (0, 0), "town02": (0, 0)},
    "regular": USUAL_TRAFFIC,
    "dense": {"town01": (100, 250), "town02": (70, 150)},
}
COLLISIONS = (InfractionKind.COLLISION_CAR, InfractionKind.COLLISION_OBJECT, InfractionKind.COLLISION_PERSON)
TRAFFIC_RULES = (*COLLISIONS, InfractionKind.RED_LIGHT, InfractionKind.OPPOSITE_LANE, InfractionKind.SIDEWALK)
QUICK_ROUTES, QUICK_WEATHERS = 2, (1, 14)
NOCRASH_SEEDS = 3  # its tables are means and deviations over so many
Towns = Mapping[str, str]  # what stands for a suite's towns elsewhere, such as CARLA's maps; empty for themselves
HERE: Towns = {}


@dataclass(frozen=True)
class Trial:
    """One episode of a suite."""

    key: str
    """Its name, which no other trial of the suite has."""
    condition: str
    """Its column in the tables; the scenario's task is its row."""
    scenario: Scenario
    """Where and among whom it drives."""
    fatal: tuple[InfractionKind, ...] = ()
    """Infractions that end the episode as a failure."""
    rules: str = "corl2017"
    """What counts as an infraction: a name in `driving.rules.RULES`."""
    repetition: int = 0
    """Which time, from 0 on, the suite drives this with another seed."""


@dataclass(frozen=True)
class TrialResult:
    """A trial that was driven."""

    trial: Trial
    """What was driven."""
    episode: EpisodeResult
    """How it went."""
    metrics: dict[str, Any]
    """Those of `EpisodeMetrics`, by name."""


def _by_weather(new: tuple[int, ...]) -> Iterator[tuple[str, str, int]]:
    """Condition, town and weather: each condition's first weather, then each one's second, and so on, so that a run
    broken off early has seen something of every cell. new: the weathers that are not the training's."""
    columns = (
        [(name, town, weather) for weather in (TRAINING_WEATHERS if known else new)]
        for name, (town, known) in CONDITIONS.items()
    )
    for row in zip_longest(*columns):
        yield from (cell for cell in row if cell is not None)


def _seed(seed: int, weather: int) -> int:
    """Other traffic and other lights in each weather, so that a driver blind to the weather drives no episode twice."""
    return 100 * seed + weather


def _corl2017(seed: int, time_limit: str, towns: Towns, routes: int = ROUTES_PER_TASK) -> Iterator[Trial]:
    """The CoRL-2017 benchmark: the four tasks in each condition and weather."""
    for condition, town, weather in _by_weather(NEW_WEATHERS):
        for task in TASKS:
            place = towns.get(town, town)
            chosen = task_scenarios(
                place, task, weather, seed=_seed(seed, weather), routes_seed=seed, time_limit=time_limit
            )[:routes]  # fmt: skip
            for k, scenario in enumerate(chosen):
                yield Trial(key=f"{town}-w{weather:02d}-{task}-{k:02d}", condition=condition, scenario=scenario)


def _route(trial: Trial) -> int:
    return int(trial.key.rpartition("-")[2])


def _corl2017_once(seed: int, time_limit: str, towns: Towns) -> list[Trial]:
    """Each route of each cell in one of its weathers, which take turns; the first of each cell before the second."""

    def is_its_turn(trial: Trial) -> bool:
        weathers = TRAINING_WEATHERS if CONDITIONS[trial.condition][1] else NEW_WEATHERS
        return trial.scenario.weather == weathers[_route(trial) % len(weathers)]

    return sorted(filter(is_its_turn, _corl2017(seed, time_limit, towns)), key=_route)


def _dynamic(seed: int, time_limit: str, towns: Towns) -> list[Trial]:
    """Of the CoRL-2017 benchmark what has cars and people: 100 km in town 1, 60 km in town 2."""
    return [trial for trial in _corl2017(seed, time_limit, towns) if trial.scenario.task == TASKS[-1]]


def _quick(seed: int, time_limit: str, towns: Towns) -> list[Trial]:
    """Some of the CoRL-2017 benchmark, in a few minutes."""
    trials = _corl2017(seed, time_limit, towns, QUICK_ROUTES)
    return [trial for trial in trials if trial.scenario.weather in QUICK_WEATHERS]


def _nocrash(seed: int, fatal: tuple[InfractionKind, ...], towns: Towns, repetitions: int) -> Iterator[Trial]:
    """The NoCrash benchmark: its routes in each density of traffic, with infractions that end an episode, several
    times with other traffic."""
    for repetition in range(repetitions):
        for condition, town, weather in _by_weather(NOCRASH_NEW_WEATHERS):
            for density, traffic in DENSITIES.items():
                cars, people = traffic[town]
                chosen = task_scenarios(
                    towns.get(town, town), "nocrash", weather, cars=cars, people=people, time_limit="nocrash",
                    name=density, seed=_seed(NOCRASH_SEEDS * seed + repetition, weather), routes_seed=seed,
                )  # fmt: skip
                for k, scenario in enumerate(chosen):
                    yield Trial(
                        key=f"{town}-w{weather:02d}-{density}-{k:02d}-s{repetition}", condition=condition,
                        scenario=scenario, fatal=fatal, rules="nocrash", repetition=repetition,
                    )  # fmt: skip


def _require_own_time_limit(time_limit: str) -> None:
    """Raises ValueError where a suite with a time limit of its own is given another."""
    if time_limit != "paper":
        raise ValueError(
            f"found --time-limit {time_limit}, wanted none: NoCrash's is the path at 5 km/h plus 20 s, leave it out"
        )


def _nocrash_suite(
    fatal: tuple[InfractionKind, ...], repetitions: int = NOCRASH_SEEDS
) -> Callable[[int, str, Towns], list[Trial]]:
    def trials(seed: int, time_limit: str, towns: Towns) -> list[Trial]:
        _require_own_time_limit(time_limit)
        return list(_nocrash(seed, fatal, towns, repetitions))

    return trials


def _generated(name: str, seed: int, time_limit: str, towns: Towns) -> list[Trial]:
    """A suite of generated towns, which is one condition, by our own strict rules."""
    scenarios = generated_scenarios(name, seed, time_limit)
    return [Trial(key, name, scenario, rules="strict") for key, scenario in scenarios]


SUITES: Mapping[str, Callable[[int, str, Towns], list[Trial]]] = {  # by name; of a seed and a kind of time limit
    "corl2017": lambda seed, time_limit, towns: list(_corl2017(seed, time_limit, towns)),
    "corl2017-once": _corl2017_once,
    "dynamic": _dynamic,
    "nocrash": _nocrash_suite(COLLISIONS),
    "nocrash-once": _nocrash_suite(COLLISIONS, repetitions=1),
    "traffic-school": _nocrash_suite(TRAFFIC_RULES),
    "quick": _quick,
    **{name: partial(_generated, name) for name in GENERATED_SUITES},
}


def suite(name: str, seed: int = 0, time_limit: str = "paper", towns: Towns = HERE) -> list[Trial]:
    """A suite by its name, or from a JSON file by `to_json`.

    time_limit: `paper` is the path at 10 km/h, `code` the authors' path at 5 km/h plus 10 s. towns: those
    that stand for the suite's. Raises ValueError for an unknown name and a file that is no suite.
    """
    if name in SUITES:
        return SUITES[name](seed, time_limit, towns)
    if name.endswith(".json"):
        return from_json(Path(name))
    raise ValueError(f"found suite {name!r}, wanted {', '.join(SUITES)} or a .json file: type --suite quick")


def to_json(trials: list[Trial]) -> str:
    """A suite as JSON."""
    rows = [
        {
            "key": trial.key,
            "condition": trial.condition,
            "fatal": [kind.value for kind in trial.fatal],
            "rules": trial.rules,
            "repetition": trial.repetition,
            "scenario": scenario_values(trial.scenario),
        }
        for trial in trials
    ]
    return json.dumps(rows, indent=1)


class _Row(TypedDict):
    """A trial as `to_json` writes it."""

    key: str
    condition: str
    scenario: dict[str, Any]
    fatal: NotRequired[tuple[InfractionKind, ...]]
    rules: NotRequired[str]
    repetition: NotRequired[int]


def is_key(text: str) -> bool:
    """Whether a text can be a trial's key, which names files."""
    return re.fullmatch(r"\w[\w.-]{0,99}", text, re.ASCII) is not None


def _trial(row: _Row) -> Trial:
    """Raises ValueError where the key holds other signs, the rules are unknown, or the scenario cannot be."""
    if not is_key(row["key"]):
        raise ValueError(f"found key {row['key']!r}, wanted letters, digits, -, _ and .")
    if (rules := row.get("rules", "corl2017")) not in RULES:
        raise ValueError(f"found rules {rules!r}, wanted {', '.join(RULES)}")
    return Trial(
        key=row["key"], condition=row["condition"], scenario=scenario_from_values(row["scenario"]),
        fatal=row.get("fatal", ()), rules=rules, repetition=row.get("repetition", 0),
    )  # fmt: skip


def from_json(path: Path) -> list[Trial]:
    """The inverse of `to_json`. Raises ValueError where the file is missing, holds something else, or a key twice."""
    if not path.is_file():
        raise ValueError(f"found no suite {path}, wanted a JSON file: look for the name, or type --suite quick")
    try:
        trials = [_trial(row) for row in read_json(path.read_bytes(), list[_Row])]
    except ValueError as error:
        raise ValueError(
            f"found that {path} is no suite ({error}), wanted a list of key, condition, scenario: see suites.to_json"
        ) from error
    keys = [trial.key for trial in trials]
    if len(set(keys)) != len(keys) or not keys:
        raise ValueError(f"found no trial or a key twice in {path}, wanted each once: give every trial its own key")
    return trials
