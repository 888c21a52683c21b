"""Cars and people: their looks follow from their ids, and only those in view are drawn."""

from __future__ import annotations

import numpy as np
import pytest

from caldrive.datatypes import PedestrianState, Pose, Semantic, VehicleState
from caldrive.world.rendering.actors import PERSON_FAR, Actors, seen_actors
from caldrive.world.rendering.pinhole import PinholeCamera
from caldrive.world.scene.people import HEIGHT

AHEAD = PinholeCamera(Pose(-10, 0, 0), height=1.2, pitch=0.0, fov=90.0, size=(200, 88)).frustum()


def seen(*states: VehicleState | PedestrianState) -> Actors:
    cars = [state for state in states if isinstance(state, VehicleState)]
    return seen_actors(AHEAD, 1.0, cars, [state for state in states if isinstance(state, PedestrianState)])


def test_a_camera_that_looks_down_sees_who_is_behind_its_middle() -> None:
    down = PinholeCamera(Pose(0, 0, 0), height=40.0, pitch=-np.pi / 2, fov=90.0, size=(64, 64)).frustum()
    assert len(seen_actors(down, 1.0, [VehicleState(Pose(-20, 0, 0))], ()).meshes) == 1


def test_the_same_id_looks_the_same_and_people_differ() -> None:
    people = [PedestrianState(Pose(float(i), 0, 0), 1.0, id=f"p{i}") for i in range(40)]
    first, again = seen(*people), seen(*people[::-1])
    assert (first.colors == again.colors[::-1]).all()
    assert len(np.unique(first.colors, axis=0)) > 20
    heights = first.scales[:, 2] * HEIGHT
    assert heights.min() >= 1.59
    assert heights.max() <= 1.91


def test_brake_lamps_are_lit_while_a_car_stands() -> None:
    colors = seen(*(VehicleState(Pose(0, 0, 0), speed, id="a") for speed in (0.0, 8.0))).colors
    assert colors[0, 3] > colors[1, 3] + 0.2


def test_a_standing_person_does_not_swing() -> None:
    swing = seen(*(PedestrianState(Pose(3, 2, 1), speed, id="a") for speed in (0.0, 1.4))).places[:, 5]
    assert swing[0] == 0
    assert abs(swing[1]) > 0.02


@pytest.mark.parametrize(
    ("x", "y", "is_seen"), [(0, 0, True), (0, 9, True), (0, 30, False), (-30, 0, False), (PERSON_FAR + 1, 0, False)]
)
def test_only_those_in_view_are_drawn(x: float, y: float, is_seen: bool) -> None:
    assert len(seen(PedestrianState(Pose(x, y, 0), 1.0, id="a")).meshes) == is_seen


def test_nobody_at_all_is_no_error() -> None:
    nobody = seen()
    assert nobody.colors.shape == (0, 12)
    assert nobody.shadows.shape == (0, 8)


def test_each_is_of_its_class_and_coarse_when_far() -> None:
    actors = seen(*(VehicleState(Pose(x, 0, 0), id="a") for x in (0, 80)), PedestrianState(Pose(0, 0, 0), 1.0, id="b"))
    assert actors.classes.tolist() == [Semantic.VEHICLE, Semantic.VEHICLE, Semantic.PERSON]
    assert actors.meshes[1] == actors.meshes[0] + 1
