"""Which actor is seen where: before a flat ground and a wall, with a car in front of it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from caldrive.carla_bridge.axes import Placement
from caldrive.carla_bridge.server.instances import Classes, instances, owners, places, semantic_scan, with_cosines
from caldrive.carla_bridge.server.lidar import Array, lidar_settings
from caldrive.datatypes import PedestrianState, Pose, Semantic, VehicleState
from caldrive.world.rendering.pinhole import PinholeCamera
from tests.carla_bridge.server.test_lidar import WALL, asked, depths, rays

CAR = VehicleState(Pose(WALL + 1.9, 0.0, 0.0), length=4.0, width=3.0)  # its rear stands out of the wall
PERSON = PedestrianState(Pose(2.0, 5.0, math.pi), radius=0.3)


def pictures(camera: PinholeCamera) -> tuple[Array, Classes]:
    """The wall is a building but where the car is."""
    distances = depths(camera)[..., 0]
    seen = places(camera, distances)
    wall, beside = np.abs(seen[..., 0] - WALL) < 1e-3, np.abs(seen[..., 1]) > 1.5
    classes = np.where(seen[..., 2] < 1e-3, Semantic.ROAD, Semantic.SKY)
    classes[wall & beside], classes[wall & ~beside & (seen[..., 2] > 0.1)] = Semantic.BUILDING, Semantic.VEHICLE
    return distances, classes.astype(np.uint8)


def test_a_point_belongs_to_the_body_that_it_is_on() -> None:
    points = np.array([(WALL, 1.4, 0.5), (WALL, 1.9, 0.5), (WALL, 1.4, 0.0), (2.2, 5.0, 1.0)])
    assert owners(points, [CAR, PERSON]).tolist() == [0, -1, -1, 1]
    assert owners(points, []).tolist() == [-1] * 4


def test_an_instance_picture_tells_the_car_from_the_wall() -> None:
    camera = PinholeCamera(Pose(0.0, 0.0, 0.0), height=1.0, pitch=0.0, fov=90.0, size=(40, 30))
    distances, classes = pictures(camera)
    seen = places(camera, distances)
    numbers = instances(camera, distances, classes, [PERSON, CAR])
    assert (numbers == 1).sum() > 10
    assert ((numbers == 1) == (classes == Semantic.VEHICLE)).all()
    assert np.abs(seen[..., 1][numbers == 1]).max() < 1.5


def test_a_semantic_lidar_may_have_no_ray_in_a_step_and_see_nothing_far_off() -> None:
    slow = lidar_settings(asked(channels="32", points_per_second="10"))
    found = semantic_scan(slow, Placement(z=1.0), 0.0, rays()._replace(views=with_cosines(pictures)), [CAR])
    assert len(found.points) == 0 == found.counts.sum()

    def empty(camera: PinholeCamera) -> tuple[Array, Classes]:
        distances, classes = pictures(camera)
        return np.where(classes == Semantic.SKY, np.inf, distances), classes

    cosines = with_cosines(empty)(PinholeCamera(Pose(0.0, 0.0, 0.0), height=1.0, pitch=0.0, fov=90.0, size=(40, 30)))
    assert np.isfinite(cosines).all()


@pytest.mark.parametrize("heading", [0.0, 0.6])
def test_a_semantic_lidar_tells_class_body_and_angle_of_each_point(heading: float) -> None:
    lidar = lidar_settings(asked(channels="5", upper_fov="4", lower_fov="-16", points_per_second="20000", range="30"))
    place = Placement(z=1.0, heading=heading)
    found = semantic_scan(lidar, place, 0.0, rays()._replace(views=with_cosines(pictures)), [CAR])
    assert len(found.points) == found.counts.sum() == len(found.bodies)
    assert ((found.bodies == 0) == (found.classes == Semantic.VEHICLE)).all()
    assert (found.bodies == 0).sum() > 20
    away = np.linalg.norm(found.points, axis=1)
    ahead = math.cos(heading) * found.points[:, 0] - math.sin(heading) * found.points[:, 1]
    wall, inside = np.isin(found.classes, (Semantic.BUILDING, Semantic.VEHICLE)), found.points[:, 2] > -0.9
    assert found.cosines[wall & inside] == pytest.approx(ahead[wall & inside] / away[wall & inside], abs=0.02)
    ground = (found.classes == Semantic.ROAD) & (away < 5.0)
    assert found.cosines[ground] == pytest.approx(1.0 / away[ground], abs=0.02)
