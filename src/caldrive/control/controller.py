"""Affordances to control: longitudinal and lateral laws, and the memory of the speed limit (section 3.2)."""

from __future__ import annotations

import math
from dataclasses import astuple

from caldrive.config import KMH, ControlConfig
from caldrive.control.lateral import steer_angle
from caldrive.control.longitudinal import Memory, longitudinal_step
from caldrive.control.pid import clip
from caldrive.datatypes import Affordances, Command, Control, Decision, DriveState


class Controller:
    """The classical controller. dt: seconds between two steps; reset() starts an episode."""

    def __init__(self, config: ControlConfig | None = None, dt: float = 0.1) -> None:
        self.config = config or ControlConfig()
        self.dt = dt
        self.reset()

    def reset(self) -> None:
        """Forget the last episode: PID, steering and the speed limit."""
        self._memory = Memory()
        self._angle = 0.0
        self._limit = self.config.initial_limit

    @property
    def speed_limit(self) -> float:
        """The limit to keep to in km/h: the last sign's, but never above the cap."""
        return self._limit if self.config.cap is None else min(self._limit, self.config.cap)

    def step(self, affordances: Affordances, speed: float, command: Command) -> Decision:
        """The control for the next dt seconds, with its reasons; speed in m/s."""
        wrong = [value for value in astuple(affordances) if value is not None and not math.isfinite(value)]
        if wrong or not math.isfinite(speed):
            return self._blind(affordances)
        if affordances.speed_sign is not None:
            self._limit = float(affordances.speed_sign)

        along = longitudinal_step(
            affordances, speed / KMH, command, self.speed_limit, self._memory, self.dt, self.config.longitudinal
        )
        self._memory = along.memory
        self._angle = steer_angle(affordances, speed, command, self._angle, self.config.lateral)
        control = Control(along.throttle, along.brake, self._steer())
        return Decision(control, affordances, along.state, self.speed_limit, along.target_speed)

    def _steer(self) -> float:
        return clip(self._angle / self.config.lateral.max_angle, -1.0, 1.0)

    def _blind(self, affordances: Affordances) -> Decision:
        """Brake and hold the wheel: what an affordance that is no number leaves to do."""
        self._memory = Memory(DriveState.BLIND)
        control = Control(0.0, self.config.blind_brake, self._steer())
        return Decision(control, affordances, DriveState.BLIND, self.speed_limit, 0.0, "an affordance is not a number")
