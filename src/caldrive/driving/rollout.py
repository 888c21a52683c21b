"""The loop: see, act, move. Driving, the benchmark and videos consume it; the recorder has one of its own."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from caldrive.datatypes import Observation, Step, Truth
from caldrive.driving.own_code import OwnCodeError, next_step, reset_agent, reset_world, step_world, truth_of
from caldrive.driving.referee import Referee
from caldrive.interfaces import Agent, World
from caldrive.results import EpisodeResult
from caldrive.scenarios import Scenario


def rollout(world: World, agent: Agent, scenario: Scenario) -> Iterator[Step]:
    """Steps without end, one each world.dt seconds, until the consumer stops; asking for the next moves the world.

    Raises OwnCodeError where the agent or somebody's world fails or returns nonsense, such as a clock that stands
    still, and what our world raises for a scenario that cannot be.
    """
    observation, number, times = reset_world(world, scenario), 0, (-math.inf, -math.inf)
    reset_agent(agent)
    while True:
        control, decision = next_step(agent, observation, number)
        truth = truth_of(world)
        times = _checked_times(world, observation, truth, times)
        yield Step(observation, truth, control, decision)
        number += 1
        observation = step_world(world, control, number)


def _checked_times(
    world: World, observation: Observation, truth: Truth, before: tuple[float, float]
) -> tuple[float, float]:
    """The times (s) of observation and truth, which must have moved on: else no episode would end. before: those of the
    last step. Raises OwnCodeError."""
    times = observation.time, truth.time
    if not all(now - then >= world.dt / 2 and now < math.inf for now, then in zip(times, before, strict=True)):
        raise OwnCodeError(
            f"found that {type(world).__name__} says {times[0]} s and {times[1]} s after {before[0]} s and "
            f"{before[1]} s, wanted both moved on by {world.dt} s: correct its step and its truth"
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
