"""Affordances to throttle and brake: five states by importance (section 3.2, supplement 1.2). Speeds in km/h here.

1. The target speed is the limit, less in turns.
2. The most important state that applies takes over: hazard stop, red light, over limit, following, cruising.
3. Its law gives one signed effort: throttle where positive, brake where negative.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import StrEnum

from caldrive.control.pid import PIDGains, PIDState, clip, pid_step
from caldrive.datatypes import Affordances, Command


class DriveState(StrEnum):
    """States of the controller in ascending importance (section 3.2), then what `patience` adds, and a last resort."""

    CRUISING = "cruising"
    FOLLOWING = "following"
    OVER_LIMIT = "over limit"
    RED_LIGHT = "red light"
    HAZARD_STOP = "hazard stop"
    CREEPING = "creeping"
    BLIND = "blind"


@dataclass(frozen=True)
class LongitudinalConfig:
    """The five states' thresholds and laws; control/presets.py has the reasons."""

    cruise: PIDGains = PIDGains(0.09, 0.02, 0.0, low=-0.3)
    """Gains of cruising: error in km/h, output throttle, or brake where negative."""
    follow: PIDGains = PIDGains(0.09, 0.01, 0.0)
    """Gains of following a car."""
    turn_reduction: float = 0.0
    """km/h that the target in a turn lies under the limit."""
    turn_speed: float = 15.0
    """km/h, the most that a turn is taken with."""
    follow_distance: float = 45.0
    """m, from which on a car ahead is followed."""
    follow_c: float = 3.0
    """km/h per m, the slope of the car-following law."""
    follow_d: float = 0.0
    """The offset of the car-following law."""
    follow_gap: float = 5.5
    """m between standing cars, from bumper to bumper."""
    over_limit_margin: float = 3.0
    """km/h above the target from which the car brakes."""
    over_limit_ratio: float = 0.0
    """Brake for each v / v* above the limit (the paper's term)."""
    over_limit_gain: float = 0.03
    """Brake for each km/h above the safe speed."""
    red_threshold: float = 0.5
    """Probability from which a light counts as red."""
    red_gain: float = 1.5
    """Brake before a red light at 30 km/h, in proportion to the speed."""
    red_floor: float = 0.8
    """The least brake before a red light; it also holds the standing car."""
    hazard_threshold: float = 0.4
    """Probability from which a hazard counts."""
    hold_speed: float = 1.0
    """km/h, asked for and driven, below which the car is held by the brake."""
    hold_brake: float = 0.3
    """The brake that holds it."""


@dataclass(frozen=True)
class Situation:
    """What the longitudinal law decides about.

    speed and limit in km/h. ceiling: km/h that the target does not exceed, whatever the limit.
    """

    affordances: Affordances
    speed: float
    command: Command
    limit: float
    ceiling: float = math.inf


@dataclass(frozen=True)
class Memory:
    """What is carried from one step to the next: the last state, and the PID of cruising or following."""

    state: DriveState = DriveState.CRUISING
    pid: PIDState = field(default_factory=PIDState)


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


def safe_target(situation: Situation, config: LongitudinalConfig) -> tuple[float, float]:
    """The target speed by limit and command, and the one that heeds the car ahead, too; km/h."""
    target = min(cruise_target(situation.limit, situation.command, config), situation.ceiling)
    distance = situation.affordances.vehicle_distance
    if distance >= config.follow_distance:
        return target, target
    return target, min(target, follow_target(distance, situation.limit, config))


def longitudinal_step(situation: Situation, memory: Memory, dt: float, config: LongitudinalConfig) -> Longitudinal:
    """Throttle and brake for one step of dt seconds."""
    speed, pid = situation.speed, PIDState()
    target, safe = safe_target(situation, config)
    state = choose_state(situation.affordances, speed, target, config)
    if state is DriveState.HAZARD_STOP:
        target, effort = 0.0, -1.0
    elif state is DriveState.RED_LIGHT:
        target, effort = 0.0, -red_light_brake(speed, config)
    elif state is DriveState.OVER_LIMIT:
        effort = -over_limit_brake(speed, target, safe, config)
    else:
        target = safe
        effort, pid = pid_effort(state, speed, target, memory, dt, config)
    return Longitudinal(max(effort, 0.0), max(-effort, 0.0), state, target, Memory(state, pid))
