"""Oracles that make their driver come close to other cars, so that hazard stops and near cars are seen in recordings.

They report something else than the truth to the controller; the labels in a recording are the truth all the same.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from caldrive.agents.cal import OraclePerception
from caldrive.collection.config import CollectConfig
from caldrive.control.longitudinal import LongitudinalConfig
from caldrive.datatypes import HAZARD_DISTANCE, MAX_VEHICLE_DISTANCE, Affordances, Observation
from caldrive.geometry import moved
from caldrive.interfaces import TruthSource
from caldrive.world.traffic.ego import VehicleConfig
from caldrive.world.truth.labels import hazard_stop

GAPS = (0.4, 4.0)  # m behind other cars at which tailgating drivers stop
EMERGENCY_SHARE = 0.6  # of its gap, at which a tailgating driver brakes hard after all


class HiddenCarsOracle(OraclePerception):
    """Reports no car ahead: the driver comes so close that it has to make a hazard stop.

    The paper sets the distance to zero for this end; its own following law would then stop the car at once.
    """

    def predict(self, observation: Observation) -> Affordances:
        """The true affordances, but for the distance: nobody is ahead."""
        return replace(super().predict(observation), vehicle_distance=MAX_VEHICLE_DISTANCE)


class TailgatingOracle(OraclePerception):
    """Reports that cars ahead are farther away: the driver stops `gap` m behind them, where they fill the image.

    A driver that stops 5 m behind every car never sees one from nearer, and its network takes what it has never seen
    for an empty street.
    """

    def __init__(self, truth_source: TruthSource, gap: float) -> None:
        super().__init__(truth_source)
        self.gap, self.front_axle = gap, VehicleConfig().front_axle

    def predict(self, observation: Observation) -> Affordances:
        """The true affordances, but for the distance, and for a hazard that is the car ahead alone."""
        truth = self.truth_source()
        true, distance = truth.affordances, truth.affordances.vehicle_distance
        reported = min(distance + LongitudinalConfig().follow_gap - self.gap, MAX_VEHICLE_DISTANCE)
        hazard = true.hazard_stop
        if EMERGENCY_SHARE * self.gap < distance < HAZARD_DISTANCE:  # the hazard may be the car alone
            hazard = float(hazard_stop(moved(truth.ego.pose, forward=self.front_axle), (), truth.pedestrians))
        return replace(true, vehicle_distance=reported, hazard_stop=hazard)


def random_oracle(
    truth_source: TruthSource, config: CollectConfig, tailgating: bool, rng: np.random.Generator
) -> OraclePerception:
    """The oracle of one recorded episode. tailgating: whether it is to come close to cars."""
    if tailgating:
        return TailgatingOracle(truth_source, float(rng.uniform(*GAPS)))
    return (HiddenCarsOracle if rng.random() < config.hidden_cars else OraclePerception)(truth_source)
