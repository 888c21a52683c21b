"""What lies under the car: shares of its area on the opposite lane and beside the road."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely

from caldrive.datatypes import Pose, VehicleState
from caldrive.geometry import box_corners, moved
from caldrive.world.roads.network import SIDEWALK_WIDTH, Lane, RoadNetwork
from caldrive.world.truth import ground_raster
from caldrive.world.truth.ground_raster import GroundRaster


@pytest.fixture(scope="module")
def raster(town02: RoadNetwork) -> GroundRaster:
    return GroundRaster(town02)


@pytest.fixture(scope="module")
def street(town02: RoadNetwork) -> Lane:
    return max(town02.driveable, key=lambda lane: lane.line.length)


def shares(raster: GroundRaster, pose: Pose, travel: float) -> tuple[float, float]:
    return raster.shares(VehicleState(pose, 5.0, length=4.2, width=1.8), travel)


def test_in_the_middle_of_every_lane_a_car_is_where_it_belongs(raster: GroundRaster, town02: RoadNetwork) -> None:
    for lane in town02.driveable:
        here = lane.line.pose_at(lane.line.length / 2)
        assert shares(raster, here, here.heading) == (0.0, 0.0)


@pytest.mark.parametrize(("left", "opposite"), [(1.0, 0.0), (2.0, 0.5), (2.45, 0.75), (3.0, 1.0), (4.0, 1.0)])
def test_the_share_over_the_centre_line_is_that_of_the_area(
    left: float, opposite: float, raster: GroundRaster, street: Lane
) -> None:
    here = street.line.pose_at(street.line.length / 2)
    row = 0.09  # one row of samples of six
    assert shares(raster, moved(here, left=left), here.heading) == pytest.approx((opposite, 0.0), abs=row)


@pytest.mark.parametrize(("left", "share"), [(-1.0, 0.0), (-2.0, 0.5), (-3.5, 1.0), (-3.0 - SIDEWALK_WIDTH, 1.0)])
def test_the_share_beyond_the_kerb_is_that_of_the_area(
    left: float, share: float, raster: GroundRaster, street: Lane
) -> None:
    here = street.line.pose_at(street.line.length / 2)
    assert shares(raster, moved(here, left=left), here.heading) == pytest.approx((0.0, share), abs=0.09)


def test_a_car_that_turned_around_in_its_lane_is_still_on_its_routes_side(raster: GroundRaster, street: Lane) -> None:
    here = street.line.pose_at(street.line.length / 2)
    assert shares(raster, moved(here, turn=math.pi), here.heading) == (0.0, 0.0)


def test_a_route_against_the_lane_makes_it_the_opposite_one(raster: GroundRaster, street: Lane) -> None:
    here = street.line.pose_at(street.line.length / 2)
    assert shares(raster, here, here.heading + math.pi)[0] == 1.0


@pytest.mark.parametrize("turn", [-math.pi / 2, math.pi / 2])
def test_a_lane_across_the_route_is_not_the_opposite_one(turn: float, raster: GroundRaster, street: Lane) -> None:
    here = street.line.pose_at(street.line.length / 2)
    assert shares(raster, here, here.heading + turn)[0] == 0.0


def test_a_slanted_car_is_on_the_sidewalk_with_its_corner_only(
    raster: GroundRaster, street: Lane, town02: RoadNetwork
) -> None:
    here = moved(street.line.pose_at(street.line.length / 2), left=-0.8, turn=-0.6)
    box = shapely.Polygon(box_corners(here, 4.2, 1.8))
    true = box.intersection(town02.sidewalk).area / box.area
    assert 0.05 < true < 0.4
    assert shares(raster, here, here.heading + 0.6)[1] == pytest.approx(true, abs=0.05)


def test_inside_a_junction_no_lane_is_the_opposite_one(raster: GroundRaster, town02: RoadNetwork) -> None:
    for lane in town02.lanes.values():
        if lane.turn is not None and lane.line.length > 10:
            middle = lane.line.pose_at(lane.line.length / 2)
            for turn in (0.0, math.pi):
                assert shares(raster, middle, middle.heading + turn)[0] == 0.0


def test_far_from_the_town_there_is_no_road(raster: GroundRaster) -> None:
    assert shares(raster, Pose(-1e4, 1e4, 0.0), 0.0) == (0.0, 1.0)


def test_what_is_no_road_is_found_all_over_the_town(raster: GroundRaster, town02: RoadNetwork) -> None:
    rng = np.random.default_rng(0)
    x0, y0, x1, y1 = town02.bounds
    places = rng.uniform((x0 - 8, y0 - 8, -3), (x1 + 8, y1 + 8, 3), (400, 3)).tolist()
    poses = [Pose(x, y, heading) for x, y, heading in places]
    boxes = [shapely.Polygon(box_corners(pose, 4.2, 1.8)) for pose in poses]
    true = [box.difference(town02.roadway).area / box.area for box in boxes]
    measured = [shares(raster, pose, 0.0)[1] for pose in poses]
    assert max(true) > 0.9
    assert measured == pytest.approx(true, abs=0.15)
    assert np.mean(np.abs(np.subtract(measured, true))) < 0.02


def test_a_raster_in_small_tiles_tells_the_same(
    raster: GroundRaster, town02: RoadNetwork, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ground_raster, "TILE", 100)  # 20 m
    monkeypatch.setattr(ground_raster, "KEPT", 2)
    tiled, rng = GroundRaster(town02), np.random.default_rng(0)
    for lane in town02.driveable[:30]:
        pose = moved(lane.line.pose_at(5.0), left=float(rng.uniform(-6, 6)), turn=float(rng.uniform(-1, 1)))
        assert shares(tiled, pose, 0.0) == shares(raster, pose, 0.0)
    assert len(tiled._tiles) == 2
