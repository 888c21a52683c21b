"""Oracles that know the truth and tell the controller something else, so that a recording shows what a driver who does
everything right never gets to see."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from caldrive.config import LongitudinalConfig, VehicleConfig
from caldrive.datatypes import HAZARD_DISTANCE, MAX_VEHICLE_DISTANCE, Affordances, Observation, Truth
from caldrive.driving.agent import OraclePerception
from caldrive.geometry import moved
from caldrive.world.labels import hazard_stop

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
