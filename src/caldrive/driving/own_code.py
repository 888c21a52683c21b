"""Agents and worlds may be anybody's code: what they return is checked here, and their errors become one sentence with
the step and the value."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import astuple
from numbers import Real
from typing import Any

from caldrive.affordances import SPECS
from caldrive.datatypes import Affordances, Command, Control, Decision, Observation, Truth, VehicleState
from caldrive.interfaces import Agent, World
from caldrive.plugins import described
from caldrive.scenarios import Scenario

# The types of fields that films, traces and the referee need.
DECISION_TYPES: dict[str, type] = {
    "affordances": Affordances, "state": str, "speed_limit": Real, "target_speed": Real, "note": str,
}  # fmt: skip
OBSERVATION_TYPES: dict[str, type] = {"time": Real, "speed": Real, "command": Command}
TRUTH_TYPES: dict[str, type] = {
    "time": Real, "ego": VehicleState, "affordances": Affordances, "vehicles": Sequence, "pedestrians": Sequence,
    "lights": Sequence, "contacts": Sequence, "opposite_share": Real, "sidewalk_share": Real, "route_done": Real,
    "route_length": Real, "goal_distance": Real, "speed_limit": Real,
}  # fmt: skip


class OwnCodeError(RuntimeError):
    """An agent or a world failed or returned nonsense; the message says in which step, and what."""


def reset_agent(agent: Agent) -> None:
    """Start an episode. An agent without a method reset has nothing to forget. Raises OwnCodeError where it fails."""
    if (reset := _call(agent, getattr, agent, "reset", None, at="at its reset")) is not None:
        _call(agent, reset, at="at its reset")


def next_step(agent: Agent, observation: Observation, number: int) -> tuple[Control, Decision | None]:
    """The agent's control for an observation, and its reasons where it gives any.

    number: of the step, from 0, for errors. Raises OwnCodeError where the agent fails or returns something else.
    """
    at = f"at step {number} ({observation.time:.1f} s)"
    control = _call(agent, agent.act, observation, at=at)
    if not isinstance(control, Control):
        raise OwnCodeError(
            f"found that {_name(agent)} returned {control!r} {at}, wanted a Control: "
            "return caldrive.Control(throttle, brake, steer)"
        )
    decision = _call(agent, getattr, agent, "decision", None, at=at)
    if decision is not None:
        _check_decision(agent, decision, at)
    # A network's numbers are often those of NumPy or torch, in 32 bits; the world reckons with Python's.
    return _call(agent, _in_pythons_numbers, control, at=at), decision


def _in_pythons_numbers(control: Control) -> Control:
    return Control(*map(float, astuple(control)))


def reset_world(world: World, scenario: Scenario) -> Observation:
    """Start an episode. Raises OwnCodeError where somebody's world fails or returns something else, and what our own
    raises for a scenario that cannot be."""
    return _observation(world, _call(world, world.reset, scenario, at="at its reset"), "at its reset")


def step_world(world: World, control: Control, number: int) -> Observation:
    """Move everything on. number: of the step that begins, from 1, for errors. Raises OwnCodeError as above."""
    at = f"at step {number}"
    return _observation(world, _call(world, world.step, control, at=at), at)


def truth_of(world: World) -> Truth:
    """What really is, now. Raises OwnCodeError as above, and where the ego is nowhere."""
    truth = _call(world, world.truth, at="in its truth")
    if not isinstance(truth, Truth):
        raise OwnCodeError(f"found that the truth of {_name(world)} is {truth!r}, wanted a Truth: correct its truth")
    _check_fields(f"the truth of {_name(world)}", truth, TRUTH_TYPES, "")
    if not all(map(math.isfinite, astuple(truth.ego.pose))):
        raise OwnCodeError(
            f"found that {_name(world)} has its ego at {truth.ego.pose}, wanted numbers: correct its truth"
        )
    return truth


def _name(owner: Agent | World) -> str:
    return type(owner).__name__


def _call(owner: Agent | World, method: Callable[..., Any], *arguments: Any, at: str) -> Any:
    """What a method of somebody's agent or world returns. Raises OwnCodeError for any of its errors."""
    try:
        return method(*arguments)
    except (OwnCodeError, KeyboardInterrupt):  # a world's, which an agent that knows the truth came upon; and Ctrl-C
        raise
    except BaseException as error:  # it may be anybody's code, and it does not end the program
        if os.environ.get("CALDRIVE_TRACEBACK") or _is_our_world(owner):
            raise
        raise OwnCodeError(f"found that {_name(owner)} failed {at} ({described(error)}): correct its code") from error


def _is_our_world(owner: Agent | World) -> bool:
    """Whether it is a world of caldrive, whose errors say themselves what to type."""
    return type(owner).__module__.startswith("caldrive.") and hasattr(owner, "truth")


def _observation(world: World, found: Any, at: str) -> Observation:
    """What a world says is seen, if it is an observation."""
    if not isinstance(found, Observation):
        raise OwnCodeError(
            f"found that {_name(world)} returned {found!r} {at}, wanted an Observation: "
            "return caldrive.Observation(time, image, speed, command)"
        )
    _check_fields(f"the observation of {_name(world)}", found, OBSERVATION_TYPES, f" {at}")
    return found


def _check_decision(agent: Agent, decision: Any, at: str) -> None:
    """Raises OwnCodeError where an agent's reasons are of no use to films, traces and reports."""
    if not isinstance(decision, Decision):
        raise OwnCodeError(
            f"found that the decision of {_name(agent)} is {decision!r} {at}, wanted a Decision or None: "
            "set it to caldrive.Decision(control, ...)"
        )
    _check_fields(f"the decision of {_name(agent)}", decision, {"control": Control}, f" {at}")
    given = {name: kind for name, kind in DECISION_TYPES.items() if getattr(decision, name) is not None}
    _check_fields(f"the decision of {_name(agent)}", decision, given, f" {at}", " or None")
    for spec in SPECS if decision.affordances is not None else ():
        value = getattr(decision.affordances, spec.name)
        if not isinstance(value, Real) and (value is not None or spec.name != "speed_sign"):
            raise OwnCodeError(
                f"found that {_name(agent)} gives {value!r} as {spec.name} {at}, wanted a number: "
                "where it does not know one, give float('nan')"
            )


def _check_fields(what: str, data: Any, types: dict[str, type], at: str, otherwise: str = "") -> None:
    """Raises OwnCodeError where a field has another type. otherwise: what is allowed beside it, in words."""
    for field, kind in types.items():
        value = getattr(data, field)
        if not isinstance(value, kind):
            wanted = "a number" if kind is Real else f"a {kind.__name__}"
            raise OwnCodeError(
                f"found that {what} has {field} {value!r}{at}, wanted {wanted}{otherwise}: correct its code"
            )
