"""Mishaps while recording: steering and speed go wrong for a moment, so that recoveries are seen (section 3.1), and the
driver starts late."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from caldrive.agents.cal import OraclePerception
from caldrive.control.longitudinal import LongitudinalConfig
from caldrive.datatypes import HAZARD_DISTANCE, MAX_VEHICLE_DISTANCE, Affordances, Control, Observation, Truth
from caldrive.geometry import moved
from caldrive.world.traffic.ego import VehicleConfig
from caldrive.world.truth.labels import hazard_stop

HARD = LongitudinalConfig.red_floor  # brake in [0, 1] before a red light and at a hazard; a car ahead may ask for it


class Disturbance:
    """Short mishaps at random times, so that recoveries are seen: triangular pushes at wheel and pedals, and a wheel
    that stays as it is, which lets the car turn in too late or keep turning for too long."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng, self.remaining, self.length, self.push, self.pedal, self.wheel = rng, 0, 1, 0.0, 0.0, 0.0

    def apply(self, control: Control, speed: float) -> Control:
        """The disturbed control. The faster the car, the weaker the push: its sideways acceleration is what counts."""
        if self.remaining == 0:
            if speed > 2.0 and self.rng.random() < 0.035:
                self._begin(control, speed)
            return control
        share = 1 - abs(2 * self.remaining / self.length - 1)
        self.remaining -= 1
        effort = control.throttle - control.brake + share * self.pedal * (control.brake < 0.3)
        steer = control.steer + share * self.push if self.push else self.wheel
        return Control(*(float(np.clip(x, low, 1)) for x, low in ((effort, 0), (-effort, 0), (steer, -1))))

    def _begin(self, control: Control, speed: float) -> None:
        self.remaining = self.length = int(self.rng.integers(6, 19))
        self.pedal = float(self.rng.choice([0.0, 0.0, -0.4, 0.5]))
        self.wheel, self.push = control.steer, 0.0
        if self.rng.random() < 0.6:
            strength = self.rng.uniform(0.3, 1.0) * min(1.0, (6.0 / speed) ** 2)
            self.push = float(self.rng.choice([-1, 1]) * strength)


class LateStart:
    """A driver who dreams on for up to 2 s, in half of the cases, where a car that stands or brakes hard may go.

    One that starts at once stands before red lights only, and a network with a memory learns that whatever it stands
    before is red; one that lets go of the brake at once is never seen standing between area A1 and the stop line.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng, self.remaining, self.asked, self.braked = rng, 0, False, False

    def apply(self, control: Control, speed: float) -> Control:
        """The control, or braking on."""
        if speed > 1.0:
            self.asked = False
        elif speed < 0.1 and control.throttle > 0 and not self.asked:
            self.asked = True
            if self.remaining == 0:  # who braked on until he stands has dreamt already
                self._dream()
        if self.braked and control.brake == 0 and speed > 0.5 and self.remaining == 0:
            self._dream()
        self.braked = control.brake >= HARD
        if self.remaining == 0:
            return control
        self.remaining -= 1
        return Control(brake=1.0, steer=control.steer)

    def _dream(self) -> None:
        self.remaining = int(self.rng.integers(5, 21)) if self.rng.random() < 0.5 else 0


LAST = 0.6  # share of its gap at which a tailgater brakes hard after all


class HiddenCars(OraclePerception):
    """Tells of no car ahead: the driver comes so close that hazard stops behind cars are seen.

    The paper sets the distance to zero for this end; its own following law would then stop the car at once.
    """

    def predict(self, observation: Observation) -> Affordances:
        return replace(super().predict(observation), vehicle_distance=MAX_VEHICLE_DISTANCE)


class Tailgater(OraclePerception):
    """Tells that cars ahead are farther away: the driver stops `gap` m behind them, where they fill the picture.

    Who stops 5 m behind every car never sees one from nearer, and its network takes what it has never seen for an empty
    street.
    """

    def __init__(self, truth_source: Callable[[], Truth], gap: float) -> None:
        super().__init__(truth_source)
        self.gap, self.front_axle = gap, VehicleConfig().front_axle

    def predict(self, observation: Observation) -> Affordances:
        truth = self.truth_source()
        true, distance = truth.affordances, truth.affordances.vehicle_distance
        told = min(distance + LongitudinalConfig().follow_gap - self.gap, MAX_VEHICLE_DISTANCE)
        hazard = true.hazard_stop
        if LAST * self.gap < distance < HAZARD_DISTANCE:  # the hazard may be the car alone
            hazard = float(hazard_stop(moved(truth.ego.pose, forward=self.front_axle), (), truth.pedestrians))
        return replace(true, vehicle_distance=told, hazard_stop=hazard)
