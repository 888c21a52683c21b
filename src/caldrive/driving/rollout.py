"""The loop: see, act, move. Driving, the benchmark and videos consume it; the recorder has one of its own.

An agent may be anybody's code, so what it returns is checked here. An error is one sentence with step and value.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator
from dataclasses import astuple
from numbers import Real
from typing import Any

from caldrive.affordances import SPECS
from caldrive.datatypes import Affordances, Control, Decision, Observation, Step, Truth
from caldrive.driving.referee import Referee
from caldrive.interfaces import Agent, World
from caldrive.plugins import described
from caldrive.results import EpisodeResult
from caldrive.scenarios import Scenario

DECISION_TYPES: dict[str, type] = {  # of a decision's fields, where they are not None
    "control": Control,
    "affordances": Affordances,
    "state": str,
    "speed_limit": Real,
    "target_speed": Real,
    "note": str,
}


class AgentError(RuntimeError):
    """An agent failed or returned nonsense; the message says in which step, and what."""


def reset_agent(agent: Agent) -> None:
    """Start an episode. An agent without a method reset has nothing to forget. Raises AgentError where it fails."""
    if (reset := getattr(agent, "reset", None)) is not None:
        _call(agent, reset, at="at its reset")


def next_step(agent: Agent, observation: Observation, number: int) -> tuple[Control, Decision | None]:
    """The agent's control for an observation, and its reasons where it gives any.

    number: of the step, from 0, for errors. Raises AgentError where the agent fails or returns something else.
    """
    at = f"at step {number} ({observation.time:.1f} s)"
    control = _call(agent, agent.act, observation, at=at)
    if not isinstance(control, Control):
        raise AgentError(
            f"found that {_name(agent)} returned {control!r} {at}, wanted a Control: "
            "return caldrive.Control(throttle, brake, steer)"
        )
    decision = getattr(agent, "decision", None)
    if decision is not None:
        _check_decision(agent, decision, at)
    # A network's numbers are often those of NumPy or torch, in 32 bits; the world reckons with Python's.
    return Control(*map(float, astuple(control))), decision


def _name(agent: Agent) -> str:
    return type(agent).__name__


def _call(agent: Agent, method: Callable[..., Any], *arguments: Any, at: str) -> Any:
    """What a method of somebody's agent returns. Raises AgentError for any of its errors."""
    try:
        return method(*arguments)
    except (Exception, SystemExit) as error:  # it may be anybody's code, and it does not end the program
        if os.environ.get("CALDRIVE_TRACEBACK"):
            raise
        raise AgentError(f"found that {_name(agent)} failed {at} ({described(error)}): correct its code") from error


def _check_decision(agent: Agent, decision: Any, at: str) -> None:
    """Raises AgentError where an agent's reasons are of no use to films, traces and reports."""
    if not isinstance(decision, Decision):
        raise AgentError(
            f"found that the decision of {_name(agent)} is {decision!r} {at}, wanted a Decision or None: "
            "set it to caldrive.Decision(control, ...)"
        )
    for field, kind in DECISION_TYPES.items():
        value = getattr(decision, field)
        if value is not None and not isinstance(value, kind):
            raise AgentError(
                f"found that the decision of {_name(agent)} has {field} {value!r} {at}, wanted "
                f"{'a number' if kind is Real else f'a {kind.__name__}'} or None: correct its code"
            )
    for spec in SPECS if decision.affordances is not None else ():
        value = getattr(decision.affordances, spec.name)
        if not isinstance(value, Real) and (value is not None or spec.name != "speed_sign"):
            raise AgentError(
                f"found that {_name(agent)} gives {value!r} as {spec.name} {at}, wanted a number: "
                "where it does not know one, give float('nan')"
            )


def rollout(world: World, agent: Agent, scenario: Scenario) -> Iterator[Step]:
    """Steps without end, one each world.dt seconds, until the consumer stops; asking for the next moves the world.

    Raises AgentError where the agent fails, ValueError where the world's clock stands still or its ego is nowhere, and
    what the world's reset raises for a scenario that cannot be.
    """
    observation, number, times = world.reset(scenario), 0, (-math.inf, -math.inf)
    reset_agent(agent)
    while True:
        control, decision = next_step(agent, observation, number)
        truth = world.truth()
        times = _checked_times(world, observation, truth, times)
        yield Step(observation, truth, control, decision)
        observation, number = world.step(control), number + 1


def _checked_times(
    world: World, observation: Observation, truth: Truth, before: tuple[float, float]
) -> tuple[float, float]:
    """The times (s) of observation and truth, which must have moved on: else no episode would end. before: those of the
    last step. Raises ValueError."""
    times = observation.time, truth.time
    if not all(now - then >= world.dt / 2 and now < math.inf for now, then in zip(times, before, strict=True)):
        raise ValueError(
            f"found that {type(world).__name__} says {times[0]} s and {times[1]} s after {before[0]} s and "
            f"{before[1]} s, wanted both moved on by {world.dt} s: correct its step and its truth"
        )
    if not all(map(math.isfinite, astuple(truth.ego.pose))):
        raise ValueError(
            f"found that {type(world).__name__} has its ego at {truth.ego.pose}, wanted numbers: correct its truth"
        )
    return times


def run_episode(
    world: World, agent: Agent, scenario: Scenario, *watchers: Callable[[Step], None], referee: Referee | None = None
) -> EpisodeResult:
    """Drive until the referee ends the episode. watchers see every step, the last included, after the referee; give the
    referee to know what it has counted by then, or to have infractions that are fatal."""
    referee = referee or Referee(scenario)
    for step in rollout(world, agent, scenario):
        outcome = referee.watch(step.truth)
        for watch in watchers:
            watch(step)
        if outcome is not None:
            break
    return referee.result()
