"""When and at what to look in an episode that failed, read from its trace: the moment in which it went wrong and those
before it, and the affordance that was most wrong until then."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from caldrive.affordances import BY_NAME, SPECS, AffordanceSpec
from caldrive.agents.settings import AgentSettings
from caldrive.benchmark.report.runs import LARGE_ERRORS, Failure
from caldrive.datatypes import SPEED_SIGNS
from caldrive.visualization.gauges import value_text

Columns = Mapping[str, list[Any]]
BEFORE = (2.0, 1.0, 0.0)  # s before an episode goes wrong, the moments that are looked at


@dataclass(frozen=True)
class Glance:
    """A moment to look at."""

    step: int
    """The number of the step."""
    x: float
    """Where the car is then, m."""
    y: float
    """Where the car is then, m."""
    title: str
    """Which moment it is."""
    text: str
    """What was seen and what was true, empty where the agent gives no affordances."""


@dataclass(frozen=True)
class Plan:
    """What to look at in an episode."""

    affordance: str | None
    """Whose attention is drawn; None where the agent gives no affordances."""
    glances: tuple[Glance, ...]
    """The moments, the last one where the episode goes wrong."""


def plan(failure: Failure, trace: Columns, driver: AgentSettings) -> Plan:
    """What to look at in an episode that failed. trace: one value a step, by name (`Trace`)."""
    time, event = decisive(failure)
    affordance = suspect(failure, trace, driver, time)
    titles = {_step(trace, time - before): f"{before:g} s before" for before in BEFORE if before <= time}
    titles[_step(trace, time)] = f"{event} at {time:.1f} s"
    glances = (
        Glance(step, trace["x"][step], trace["y"][step], title, _in_words(trace, step, affordance, driver))
        for step, title in titles.items()
    )
    return Plan(affordance, tuple(glances))


def decisive(failure: Failure) -> tuple[float, str]:
    """When an episode went wrong (s), and what happened then: its first infraction of its own fault, or else how it
    came to miss its goal."""
    episode = failure.result.episode
    for infraction in episode.infractions:
        if infraction.at_fault:
            return infraction.time, infraction.kind.value
    if failure.cause is not None:
        return failure.cause.time, failure.cause.event
    return episode.duration, episode.outcome.value


def suspect(failure: Failure, trace: Columns, driver: AgentSettings, time: float) -> str | None:
    """The affordance to look at: the one to blame, and among several, or where nobody is, the one that is most wrong
    in the seconds until `time` (s). None where the agent gives no affordances."""
    times = np.array(trace["time"])
    before = (times >= time - max(BEFORE)) & (times <= time)
    steps = np.flatnonzero(before & ~np.isnan(_column(trace, "relative_angle")))
    if not len(steps):
        return None
    blamed = [spec for spec in SPECS if spec.title in failure.explanation.blamed]
    return max(blamed or _that_count(driver), key=lambda spec: _wrongness(trace, steps, spec)).name


def _that_count(driver: AgentSettings) -> Sequence[AffordanceSpec]:
    """Those that can spoil an episode: no sign does where none is below the driver's own cap."""
    signs_count = driver.cap is None or driver.cap > min(SPEED_SIGNS)
    return [spec for spec in SPECS if signs_count or spec.name != "speed_sign"]


def _wrongness(trace: Columns, steps: NDArray[np.intp], spec: AffordanceSpec) -> float:
    """The mean error in some steps, as a multiple of the one from which the affordance counts as wrong."""
    predicted, true = (_column(trace, spec.name, kind)[steps] for kind in ("predicted", "true"))
    if spec.binary:
        errors = (predicted > 0.5) != (true > 0.5)
    elif spec.discrete:
        errors = np.nan_to_num(predicted) != np.nan_to_num(true)
    else:
        errors = np.abs(predicted - true)
    return float(np.mean(errors)) / LARGE_ERRORS[spec.name]


def _column(trace: Columns, name: str, kind: str = "predicted") -> NDArray[np.float64]:
    """An affordance in each step (N,), NaN where there is none."""
    return np.array(trace[f"{kind}_{name}"], dtype=float)


def _step(trace: Columns, time: float) -> int:
    """The step that is nearest to a time in s."""
    return int(np.abs(np.array(trace["time"]) - time).argmin())


def _in_words(trace: Columns, step: int, affordance: str | None, driver: AgentSettings) -> str:
    """What an affordance was seen as, and what was true."""
    if affordance is None:
        return ""
    spec = BY_NAME[affordance]
    predicted, true = (trace[f"{kind}_{affordance}"][step] for kind in ("predicted", "true"))
    if spec.name == "speed_sign":  # no sign is an answer, too
        predicted, true = predicted or 0, true or 0
    seen = "not seen" if affordance in driver.blind else f"seen {value_text(spec, predicted)}"
    truth = ("yes" if true > 0.5 else "no") if spec.binary else value_text(spec, true)
    return f"{spec.title}: {seen}, true {truth}"
