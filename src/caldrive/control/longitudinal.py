"""Affordances to throttle and brake: five states by importance (section 3.2, supplement 1.2). Speeds in km/h here.

1. The target speed is the limit, less in turns.
2. The most important state that applies takes over: hazard stop, red light, over limit, following, cruising.
3. Its law gives one signed effort: throttle where positive, brake where negative.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

from caldrive.config import LongitudinalConfig
from caldrive.control.pid import PIDState, clip, pid_step
from caldrive.datatypes import Affordances, Command, DriveState

CAR_AS_HAZARD = 15.0  # m; a car that is a hazard is nearer, unless its middle lies beside A3


@dataclass(frozen=True)
class Memory:
    """What is carried from one step to the next: the last state, the PID of cruising or following, the seconds that
    the car has stood before a hazard that is no car, and before a red light, and how often it rolled on before it."""

    state: DriveState = DriveState.CRUISING
    pid: PIDState = field(default_factory=PIDState)
    waited: float = 0.0
    waited_red: float = 0.0
    rolls: int = 0


@dataclass(frozen=True)
class Longitudinal:
    """throttle and brake in [0, 1], never both above 0; the state, the target speed in km/h, the memory to carry on."""

    throttle: float
    brake: float
    state: DriveState
    target_speed: float
    memory: Memory


def cruise_target(limit: float, command: Command, config: LongitudinalConfig) -> float:
    """v* in km/h: the limit, in turns less by config.turn_reduction and at most config.turn_speed."""
    if command is Command.STRAIGHT:
        return limit
    return max(0.0, min(limit - config.turn_reduction, config.turn_speed))


def follow_target(distance: float, v_max: float, config: LongitudinalConfig) -> float:
    """The car-following law v* = v_max (1 - exp(-c (l - gap) / v_max - d)) in km/h, within [0, v_max]; l in m.

    Section 3.2 prints the d outside the exponential, 1 - exp(-c l / v_max) - d, which with the authors' c = 3, d = -0.5
    asks for half the limit at the other car's bumper. Inside it, as their program has it and as here, the law asks
    for 0 at l = v_max / 6 (5 m at 30 km/h) and nears v_max far away.
    """
    if v_max <= 0:
        return 0.0
    exponent = -config.follow_c * (distance - config.follow_gap) / v_max - config.follow_d
    return clip(v_max * (1 - math.exp(min(exponent, 1.0))), 0.0, v_max)


def choose_state(affordances: Affordances, speed: float, target: float, config: LongitudinalConfig) -> DriveState:
    """The most important state that applies; speed and target in km/h."""
    if affordances.hazard_stop > config.hazard_threshold:
        return DriveState.HAZARD_STOP
    if affordances.red_light > config.red_threshold:
        return DriveState.RED_LIGHT
    if speed - target > config.over_limit_margin:
        return DriveState.OVER_LIMIT
    if affordances.vehicle_distance < config.follow_distance:
        return DriveState.FOLLOWING
    return DriveState.CRUISING


def seconds_waited(seen: bool, waited: float, patience: float, standing: bool, dt: float) -> float:
    """How long the car has stood before what it sees, or has crept on since it lost patience."""
    return waited + dt if seen and (standing or waited >= patience) else 0.0


def without_errors(
    affordances: Affordances, speed: float, memory: Memory, dt: float, config: LongitudinalConfig
) -> tuple[Affordances, Memory]:
    """What to stop for: not for a hazard that is no car and stays for longer than any does; and before a light that
    stays red for long the car rolls on a little, from where it may look otherwise, and waits anew, red_rolls times.

    Returns the memory with the seconds waited, too; speed in km/h.
    """
    standing = speed < config.hold_speed
    hazard = affordances.hazard_stop > config.hazard_threshold and affordances.vehicle_distance >= CAR_AS_HAZARD
    red = affordances.red_light > config.red_threshold
    waited = seconds_waited(hazard, memory.waited, config.hazard_patience, standing, dt)
    waited_red = memory.waited_red
    if red or not standing:  # a light that flickers before a standing car is still the same
        waited_red = seconds_waited(red, waited_red, config.red_patience, standing, dt)
    rolls = memory.rolls if red or standing else 0
    if waited_red >= config.red_patience + config.red_roll:
        waited_red, rolls = 0.0, rolls + 1
    if waited >= config.hazard_patience:
        affordances = replace(affordances, hazard_stop=0.0)
    if waited_red >= config.red_patience and rolls < config.red_rolls:
        affordances = replace(affordances, red_light=0.0)
    return affordances, replace(memory, waited=waited, waited_red=waited_red, rolls=rolls)


def over_limit_brake(speed: float, target: float, safe: float, config: LongitudinalConfig) -> float:
    """Brake in [0, 1]: ratio v / v* + gain (v - v_safe), where v_safe heeds a car ahead too; speeds in km/h.

    The paper has only the first term, with ratio 0.3: 90 km/h in a 30 zone gives 0.9.
    """
    ratio = speed / max(target, 1.0)
    return clip(config.over_limit_ratio * ratio + config.over_limit_gain * (speed - safe), 0.0, 1.0)


def red_light_brake(speed: float, config: LongitudinalConfig) -> float:
    """Brake in [0, 1]: gain v / 30, but at least the floor, which also holds the standing car; speed in km/h."""
    return clip(config.red_gain * speed / 30, config.red_floor, 1.0)


def carried_pid(memory: Memory, state: DriveState) -> PIDState:
    """The PID's past as far as it is of use in this state.

    Cruising and following need the same throttle on the same road, so they hand the integral over, but not the error:
    its jump would kick the derivative. After braking the past is worth nothing.
    """
    if memory.state is state:
        return memory.pid
    if {memory.state, state} == {DriveState.CRUISING, DriveState.FOLLOWING}:
        return PIDState(integral=memory.pid.integral)
    return PIDState()


def pid_effort(
    state: DriveState, speed: float, target: float, memory: Memory, dt: float, config: LongitudinalConfig
) -> tuple[float, PIDState]:
    """Signed effort in [-1, 1] of cruising or following, and the PID's new state; a car that should stand is held."""
    gains = config.cruise if state is DriveState.CRUISING else config.follow
    pid, effort = pid_step(gains, carried_pid(memory, state), target - speed, dt)
    if max(target, speed) < config.hold_speed:
        return -config.hold_brake, PIDState()
    return effort, pid


def longitudinal_step(
    affordances: Affordances,
    speed: float,
    command: Command,
    limit: float,
    memory: Memory,
    dt: float,
    config: LongitudinalConfig,
) -> Longitudinal:
    """Throttle and brake for one step of dt seconds; speed and limit in km/h."""
    target, seen = cruise_target(limit, command, config), affordances
    affordances, memory = without_errors(seen, speed, memory, dt, config)
    if affordances is not seen:
        target = min(target, config.creep_speed)
    state = choose_state(affordances, speed, target, config)
    safe = target
    if affordances.vehicle_distance < config.follow_distance:
        safe = min(target, follow_target(affordances.vehicle_distance, limit, config))

    pid = PIDState()
    if state is DriveState.HAZARD_STOP:
        target, effort = 0.0, -1.0
    elif state is DriveState.RED_LIGHT:
        target, effort = 0.0, -red_light_brake(speed, config)
    elif state is DriveState.OVER_LIMIT:
        effort = -over_limit_brake(speed, target, safe, config)
    else:
        target = safe
        effort, pid = pid_effort(state, speed, target, memory, dt, config)
    return Longitudinal(max(effort, 0.0), max(-effort, 0.0), state, target, replace(memory, state=state, pid=pid))
