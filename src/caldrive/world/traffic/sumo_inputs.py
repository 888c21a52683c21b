"""What SUMO's cars are told of what SUMO does not know: our traffic lights, and our people on the road."""

from __future__ import annotations

import math
from collections.abc import Sequence

import libsumo
import numpy as np
from numpy.typing import NDArray

from caldrive.compiled import compiled
from caldrive.datatypes import LightState, PedestrianState, Points, VehicleState
from caldrive.geometry import boxes_of, positions
from caldrive.world.traffic.traffic_lights import Phase, TrafficLights

_LETTER = {LightState.GREEN: "G", LightState.YELLOW: "y", LightState.RED: "r"}
PEOPLE_AHEAD = 30.0  # m ahead of a car's front within which it sees somebody
COMFORTABLE_BRAKE = 4.0  # m/s²
STOPPING_GAP = 2.5  # m from somebody to the standing car
HALF_CORRIDOR, HALF_BONNET = 2.2, 1.2  # m to either side of the car's middle, ahead of it and beside its front
BESIDE = 1.0  # m ahead of the front up to which somebody stands beside the bonnet
NOTICE = 1.0  # m/s below the cap from which on a car is told


class SumoLights:
    """Tells the running simulation what some lights show. Links without a post stay green: a map may name lights where
    no post stands, and nobody would know to wait there."""

    def __init__(self, lights: TrafficLights) -> None:
        self.lights = lights
        self._rows: dict[str, list[str]] = {}  # what each link of a light shows
        self._phases: dict[str, Phase] = {}
        for name in libsumo.trafficlight.getIDList():
            self._rows[name] = ["G"] * len(libsumo.trafficlight.getControlledLinks(name))
            libsumo.trafficlight.setRedYellowGreenState(name, "".join(self._rows[name]))
        self.update()

    def update(self) -> None:
        """Passes on what changed since the last time."""
        for name, junction in self.lights.junctions.items():
            if self._phases.get(name) is junction.phase:
                continue
            self._phases[name] = junction.phase
            row = self._rows[name]
            for post, state in zip(junction.posts, junction.states(), strict=True):
                for link in post.links:
                    row[link] = _LETTER[state]
            libsumo.trafficlight.setRedYellowGreenState(name, "".join(row))


def speed_caps(cars: Sequence[VehicleState], people: Sequence[PedestrianState]) -> dict[str, float]:
    """How fast some cars may drive (m/s), by their ids, so that they stop before anybody on the road; those whose speed
    this changes."""
    walkers = positions(person for person in people if person.on_road)
    if not len(walkers):
        return {}
    boxes = boxes_of(cars)
    allowed = np.empty(len(boxes))
    _allowed_speeds(boxes, walkers, allowed)
    return {cars[i].id: float(allowed[i]) for i in np.flatnonzero(allowed < boxes[:, 3] + NOTICE).tolist()}


@compiled
def _allowed_speeds(boxes: Points, people: Points, allowed: NDArray[np.float64]) -> None:
    """Writes how fast each car may drive (m/s); boxes: see `geometry.boxes_of`; people: (N, 2) on the road."""
    for k in range(len(boxes)):
        c, s, gap = math.cos(boxes[k, 2]), math.sin(boxes[k, 2]), math.inf
        for person in range(len(people)):
            dx, dy = people[person, 0] - boxes[k, 0], people[person, 1] - boxes[k, 1]
            ahead, left = dx * c + dy * s - boxes[k, 4], dy * c - dx * s
            # Who stands beside the bonnet waits for the car to pass, so the car must not wait for them.
            half_width = HALF_CORRIDOR if ahead > BESIDE else HALF_BONNET
            if abs(left) < half_width and -BESIDE < ahead < PEOPLE_AHEAD:
                gap = min(gap, max(ahead - STOPPING_GAP, 0.0))
        allowed[k] = math.sqrt(2 * COMFORTABLE_BRAKE * gap)
