"""Cars and people as instances: their looks follow from their ids."""

from __future__ import annotations

import numpy as np

from caldrive.datatypes import PedestrianState, Pose, VehicleState
from caldrive.world.rendering.actors import car_actors, person_actors
from caldrive.world.scene.people import HEIGHT


def test_the_same_id_looks_the_same_and_people_differ() -> None:
    people = [PedestrianState(Pose(float(i), 0, 0), 1.0, id=f"p{i}") for i in range(40)]
    first, again = person_actors(people), person_actors(people[::-1])
    assert (first.instances["colors"] == again.instances["colors"][::-1]).all()
    assert len(np.unique(first.instances["colors"].reshape(40, -1), axis=0)) > 20
    heights = first.instances["scale"][:, 2] * HEIGHT
    assert heights.min() >= 1.59
    assert heights.max() <= 1.91


def test_brake_lamps_are_lit_while_a_car_stands() -> None:
    colors = car_actors([VehicleState(Pose(0, 0, 0), speed, id="a") for speed in (0.0, 8.0)]).instances["colors"]
    assert colors[0, 1, 0] > colors[1, 1, 0] + 50


def test_a_standing_person_does_not_swing() -> None:
    instances = person_actors([PedestrianState(Pose(3, 2, 1), speed, id="a") for speed in (0.0, 1.4)]).instances
    assert instances["scale"][0, 3] == 0
    assert instances["scale"][1, 3] > 0.2
