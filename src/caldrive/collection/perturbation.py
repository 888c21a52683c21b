"""Perturbed controls while recording, so that recoveries are seen (section 3.1): steering and pedals go wrong for a
moment, and the driver starts late. What the driver wanted is recorded beside what moved the car."""

from __future__ import annotations

import numpy as np

from caldrive.control.longitudinal import LongitudinalConfig
from caldrive.datatypes import Control

# A perturbation begins in so many of the steps, in a car faster than so many m/s, and lasts so many steps.
START_RATE, MIN_SPEED, STEPS = 0.035, 2.0, (6, 18)
PUSH_RATE, PUSHES = 0.6, (0.3, 1.0)  # share of the perturbations that push the wheel, and how far up to PUSH_SPEED
PUSH_SPEED = 6.0  # m/s, above which the push weakens with the square of the speed
PEDALS = (0.0, 0.0, -0.4, 0.5)  # one of these at random: brake (-) or throttle (+)
FIRM_BRAKE = 0.3  # from which the pedals are left alone
# A late start lasts so many steps, in so many of the cases.
DELAY_STEPS, DELAY_RATE = (5, 20), 0.5
STANDING_SPEED, DRIVING_SPEED, ROLLING_SPEED = 0.1, 1.0, 0.5  # m/s: stands, drives again, brakes to a stand still
HARD_BRAKE = LongitudinalConfig.red_floor  # before a red light and at a hazard; a car ahead may ask for as much


class ControlPerturbation:
    """Short perturbations at random times: triangular pushes at wheel and pedals, or a wheel that stays as it is, so
    that the car turns in too late or keeps turning for too long."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng
        self._remaining, self._length = 0, 1  # steps
        self._push, self._pedal, self._wheel = 0.0, 0.0, 0.0

    def apply(self, control: Control, speed: float) -> Control:
        """The perturbed control; speed in m/s. The faster the car, the weaker the push: its lateral acceleration is
        what counts."""
        if self._remaining == 0:
            if speed > MIN_SPEED and self.rng.random() < START_RATE:
                self._begin(control, speed)
            return control
        share = 1 - abs(2 * self._remaining / self._length - 1)
        self._remaining -= 1
        effort = control.throttle - control.brake + share * self._pedal * (control.brake < FIRM_BRAKE)
        steer = control.steer + share * self._push if self._push else self._wheel
        throttle, brake, steer = (float(np.clip(x, low, 1)) for x, low in ((effort, 0), (-effort, 0), (steer, -1)))
        return Control(throttle=throttle, brake=brake, steer=steer)

    def _begin(self, control: Control, speed: float) -> None:
        low, high = STEPS
        self._remaining = self._length = int(self.rng.integers(low, high + 1))
        self._pedal = float(self.rng.choice(PEDALS))
        self._wheel, self._push = control.steer, 0.0
        if self.rng.random() < PUSH_RATE:
            strength = self.rng.uniform(*PUSHES) * min(1.0, (PUSH_SPEED / speed) ** 2)
            self._push = float(self.rng.choice([-1, 1]) * strength)


class DelayedStart:
    """A driver who brakes on for up to 2 s, in half of the cases, where a car that stands or brakes hard may go.

    A driver that starts at once stands before red lights only, and a network with a history learns that whatever it
    stands before is red. One that lets go of the brake at once is never seen standing between area A1 and the stop
    line.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng
        self._remaining = 0  # steps
        self._has_started, self._braked_hard = False, False

    def apply(self, control: Control, speed: float) -> Control:
        """The control, or braking on; speed in m/s."""
        if speed > DRIVING_SPEED:
            self._has_started = False
        elif speed < STANDING_SPEED and control.throttle > 0 and not self._has_started:
            self._has_started = True
            if self._remaining == 0:  # who braked on until the car stands has been late already
                self._delay()
        if self._braked_hard and control.brake == 0 and speed > ROLLING_SPEED and self._remaining == 0:
            self._delay()
        self._braked_hard = control.brake >= HARD_BRAKE
        if self._remaining == 0:
            return control
        self._remaining -= 1
        return Control(brake=1.0, steer=control.steer)

    def _delay(self) -> None:
        low, high = DELAY_STEPS
        self._remaining = int(self.rng.integers(low, high + 1)) if self.rng.random() < DELAY_RATE else 0
