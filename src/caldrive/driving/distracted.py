"""Oracles that know the truth and tell the controller something else, so that a recording shows what a driver who does
everything right never gets to see."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from caldrive.config import LongitudinalConfig
from caldrive.datatypes import MAX_VEHICLE_DISTANCE, Affordances, Observation, Truth
from caldrive.driving.agent import OraclePerception

NEAR = 6.0  # m; where a car that is a hazard is nearer
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
        self.gap = gap

    def predict(self, observation: Observation) -> Affordances:
        truth = super().predict(observation)
        distance = truth.vehicle_distance
        told = min(distance + LongitudinalConfig().follow_gap - self.gap, MAX_VEHICLE_DISTANCE)
        ignored = LAST * self.gap < distance < NEAR
        return replace(truth, vehicle_distance=told, hazard_stop=0.0 if ignored else truth.hazard_stop)
