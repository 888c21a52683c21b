"""Affordances to control: longitudinal and lateral laws, patience, and the memory of the speed limit (section 3.2)."""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass

from caldrive.control.lateral import LateralConfig, steer_angle
from caldrive.control.longitudinal import DriveState, LongitudinalConfig, Memory, Situation, longitudinal_step
from caldrive.control.patience import CAR_AS_HAZARD, PatienceConfig, Waiting, next_waiting, overridden
from caldrive.control.pid import clip
from caldrive.datatypes import DT, KMH, Affordances, Command, Control, Decision

SIGN_LEAVES = 7.4  # m ahead of the front axle where a sign leaves the view: there the area A1 of Fig. 4 begins


@dataclass(frozen=True)
class ControlConfig:
    """The controller and all its constants. Presets: control/presets.py; a TOML file with the same names sets any."""

    longitudinal: LongitudinalConfig = LongitudinalConfig()
    """Throttle and brake."""
    lateral: LateralConfig = LateralConfig()
    """Steering."""
    patience: PatienceConfig = PatienceConfig()
    """What happens where the car stands for long."""
    initial_limit: float = 30.0
    """km/h before the first sign."""
    cap: float | None = None
    """km/h that no limit exceeds; without it the signs alone count."""
    blind_brake: float = 0.5
    """Brake in [0, 1] where an affordance is not a number."""


class CALController:
    """The classical controller (`interfaces.Controller`). dt: seconds between two steps."""

    def __init__(self, config: ControlConfig | None = None, dt: float = DT) -> None:
        self.config = config or ControlConfig()
        self.dt = dt
        self.reset()

    def reset(self) -> None:
        """Forget the last episode: PID, steering, the speed limit and how long the car has waited."""
        self._memory, self._waiting = Memory(), Waiting()
        self._angle = 0.0
        self._limit = self._sign = self.config.initial_limit  # in force, and the last sign's
        self._before_sign = 0.0  # m

    @property
    def speed_limit(self) -> float:
        """The limit to keep to in km/h: the last sign's, but never above the cap."""
        return self._limit if self.config.cap is None else min(self._limit, self.config.cap)

    def step(self, affordances: Affordances, speed: float, command: Command) -> Decision:
        """The control for the next dt seconds, with its reasons; speed in m/s."""
        wrong = [value for value in astuple(affordances) if value is not None and not math.isfinite(value)]
        if wrong or not math.isfinite(speed):
            return self._blind(affordances)
        self._read(affordances.speed_sign, speed)

        patient, note = self._wait(affordances, speed / KMH)
        ceiling = math.inf if patient is affordances else self.config.patience.creep_speed
        situation = Situation(patient, speed / KMH, command, self.speed_limit, ceiling)
        along = longitudinal_step(situation, self._memory, self.dt, self.config.longitudinal)
        self._memory = along.memory
        self._angle = steer_angle(affordances, speed, command, self._angle, self.config.lateral)
        control = Control(along.throttle, along.brake, self._steer())
        stopped = along.state in (DriveState.HAZARD_STOP, DriveState.RED_LIGHT)
        state = DriveState.CREEPING if note and not stopped else along.state
        return Decision(control, affordances, state, self.speed_limit, along.target_speed, note)

    def _read(self, sign: float | None, speed: float) -> None:
        """A lower limit counts from when its sign is seen on, a higher one from the sign on; speed in m/s."""
        if sign is not None:
            self._sign, self._before_sign = float(sign), SIGN_LEAVES
            self._limit = min(self._limit, self._sign)
        else:
            self._before_sign -= speed * self.dt
            if self._before_sign <= 0:
                self._limit = self._sign

    def _wait(self, affordances: Affordances, speed: float) -> tuple[Affordances, str]:
        """The affordances without what the car has waited for long enough, and a note on it; speed in km/h."""
        config, laws = self.config.patience, self.config.longitudinal
        if not config.enabled:
            return affordances, ""
        hazard = affordances.hazard_stop > laws.hazard_threshold
        red, standing = affordances.red_light > laws.red_threshold, speed < config.standing_speed
        no_car = hazard and affordances.vehicle_distance >= CAR_AS_HAZARD
        self._waiting = next_waiting(no_car, red, standing, self._waiting, self.dt, config)
        return overridden(affordances, self._waiting, hazard, red, config)

    def _steer(self) -> float:
        return clip(self._angle / self.config.lateral.max_angle, -1.0, 1.0)

    def _blind(self, affordances: Affordances) -> Decision:
        """Brake and hold the wheel: what an affordance that is no number leaves to do."""
        self._memory, self._waiting = Memory(DriveState.BLIND), Waiting()
        control = Control(0.0, self.config.blind_brake, self._steer())
        return Decision(control, affordances, DriveState.BLIND, self.speed_limit, 0.0, "an affordance is not a number")
