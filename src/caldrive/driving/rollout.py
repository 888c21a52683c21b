"""The one loop: see, act, move. Driving, recording, the benchmark and videos all consume it."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from typing import Any

from caldrive.datatypes import Control, Decision, Observation, Step
from caldrive.driving.referee import Referee
from caldrive.interfaces import Agent, World
from caldrive.plugins import described
from caldrive.results import EpisodeResult
from caldrive.scenarios import Scenario


class AgentError(RuntimeError):
    """An agent failed or returned nonsense; the message says in which step, and what."""


def _name(agent: Agent) -> str:
    return type(agent).__name__


def _called(agent: Agent, method: Callable[..., Any], *arguments: Any, moment: str) -> Any:
    """What a method of somebody's agent returns. Raises AgentError for any of its errors."""
    try:
        return method(*arguments)
    except Exception as error:  # it may be anybody's code
        if os.environ.get("CALDRIVE_TRACEBACK"):
            raise
        raise AgentError(f"found that {_name(agent)} failed {moment} ({described(error)}): correct its code") from error


def _acted(agent: Agent, observation: Observation, number: int) -> tuple[Control, Decision | None]:
    """The agent's control, and its reasons where it gives any. Raises AgentError where these are something else."""
    moment = f"at step {number} ({observation.time:.1f} s)"
    control = _called(agent, agent.act, observation, moment=moment)
    if not isinstance(control, Control):
        raise AgentError(
            f"found that {_name(agent)} returned {control!r} {moment}, wanted a Control: "
            "return caldrive.Control(throttle, brake, steer)"
        )
    decision = getattr(agent, "decision", None)
    if not isinstance(decision, Decision | None):
        raise AgentError(
            f"found that the decision of {_name(agent)} is {decision!r} {moment}, wanted a Decision or None: "
            "set it to caldrive.Decision(control, ...)"
        )
    return control, decision


def rollout(world: World, agent: Agent, scenario: Scenario) -> Iterator[Step]:
    """Steps without end, one each world.dt seconds, until the consumer stops; asking for the next moves the world.

    Raises AgentError where the agent fails, as the world's reset does for a scenario that cannot be.
    """
    observation, number = world.reset(scenario), 0
    if reset := getattr(agent, "reset", None):
        _called(agent, reset, moment="at its reset")
    while True:
        control, decision = _acted(agent, observation, number)
        yield Step(observation, world.truth(), control, decision)
        observation, number = world.step(control), number + 1


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
