"""The one loop: see, act, move. Driving, recording, the benchmark and videos all consume it."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from caldrive.datatypes import Scenario, Step
from caldrive.driving.referee import Referee
from caldrive.interfaces import Agent, World
from caldrive.results import EpisodeResult


def rollout(world: World, agent: Agent, scenario: Scenario) -> Iterator[Step]:
    """Steps without end, one each world.dt seconds, until the consumer stops; asking for the next moves the world."""
    observation = world.reset(scenario)
    agent.reset()
    while True:
        control = agent.act(observation)
        yield Step(observation, world.truth(), control, agent.decision)
        observation = world.step(control)


def run_episode(
    world: World,
    agent: Agent,
    scenario: Scenario,
    on_step: Callable[[Step], None] | None = None,
    referee: Referee | None = None,
) -> EpisodeResult:
    """Drive until the referee ends the episode. on_step sees every step, the last included, after the referee; give the
    referee to know what it has counted by then, or to have infractions that are fatal."""
    referee = referee or Referee(scenario)
    for step in rollout(world, agent, scenario):
        outcome = referee.watch(step.truth)
        if on_step is not None:
            on_step(step)
        if outcome is not None:
            break
    return referee.result()
