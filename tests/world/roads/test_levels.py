"""What is on a bridge is not in the lane below, and what is below is not on the bridge."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
import shapely

from caldrive.datatypes import Control, Pose
from caldrive.scenarios import Scenario
from caldrive.world.embedded import EmbeddedWorld
from caldrive.world.roads.levels import RouteLevel, crossings
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.roads.route import plan_route
from caldrive.world.roads.towns import load_roads
from caldrive.world.scene.streets import lane_chains
from tests.maps import road, sign_at, straight, write_roads

needs_netconvert = pytest.mark.skipif(
    not pytest.importorskip("importlib.util").find_spec("sumo"), reason="netconvert comes with the extra opendrive"
)
EAST, NORTH = (Pose(20, -2, 0), Pose(280, -2, 0)), (Pose(152, -130, math.pi / 2), Pose(152, 130, math.pi / 2))
ANGLE = 0.2  # rad between the oblique bridge's road and the one below


def write_bridge(folder: Path, height: float = 6.0, signals: str = "", oblique: bool = False) -> Path:
    """Road 1 runs east; road 2 runs north over it, or nearly along it."""
    line = (
        straight(150 - 150 * math.cos(ANGLE), -150 * math.sin(ANGLE), ANGLE, 300)
        if oblique
        else straight(150, -150, math.pi / 2, 300)
    )
    above = road(2, line, signals=signals)
    profile = f'<elevationProfile><elevation s="0" a="{height}" b="0" c="0" d="0"/></elevationProfile><lanes>'
    return write_roads(folder, road(1, straight(0, 0, 0, 300)), above.replace("<lanes>", profile))


@pytest.fixture
def bridge(tmp_path: Path) -> RoadNetwork:
    return load_roads(str(write_bridge(tmp_path)))


@needs_netconvert
def test_where_roads_run_above_each_other_is_known(bridge: RoadNetwork, tmp_path: Path) -> None:
    assert crossings(bridge).equals(shapely.box(146, -4, 154, 4))
    low = load_roads(str(write_bridge(tmp_path / "..", height=1.0)))
    assert low.is_flat
    assert crossings(low).is_empty


def test_our_towns_are_flat(town: RoadNetwork) -> None:
    assert town.is_flat
    assert crossings(town).is_empty


@needs_netconvert
@pytest.mark.parametrize(("way", "height"), [(EAST, 0.0), (NORTH, 6.0)], ids=["below", "above"])
def test_a_route_holds_what_is_at_its_height(way: tuple[Pose, Pose], height: float, bridge: RoadNetwork) -> None:
    level = RouteLevel(bridge, plan_route(bridge, *way))
    assert level.holds(150, 0, height)
    assert not level.holds(150, 0, 6.0 - height)
    assert level.holds(150 + 60, 60, 6.0 - height), "far beside the route nothing is in the way"


@needs_netconvert
def test_no_marking_of_either_road_runs_across_the_other(bridge: RoadNetwork) -> None:
    for chain in lane_chains(bridge):
        assert not shapely.LineString(chain.line.points).intersects(shapely.box(146, -4, 154, 4))


@needs_netconvert
def test_who_drives_below_meets_nobody_from_the_bridge(tmp_path: Path) -> None:
    path = str(write_bridge(tmp_path))
    world = EmbeddedWorld()
    world.reset(Scenario(town=path, weather=1, start=EAST[0], goal=EAST[1], n_vehicles=12, seed=1))
    seen = set()
    for _ in range(100):
        world.step(Control(brake=1.0))
        near = [car for car in world.truth().vehicles if abs(car.pose.y) < 20]
        seen |= {round(math.sin(car.pose.heading)) for car in near}
    world.close()
    assert seen == {0}


@needs_netconvert
@pytest.mark.parametrize(("above", "limit"), [(True, 30), (False, None)])
def test_a_sign_on_the_bridge_counts_on_the_bridge_alone(above: bool, limit: int | None, tmp_path: Path) -> None:
    path = str(write_bridge(tmp_path, oblique=True, signals=sign_at(140, limit=30)))
    roads = load_roads(path)
    beside = next(lane for lane in roads.driveable if lane.id == ("-2_0" if above else "-1_0"))
    world = EmbeddedWorld()
    goal = beside.line.pose_at(290)
    found = set()
    for s in range(100, 150):
        world.reset(Scenario(town=path, weather=1, start=beside.line.pose_at(float(s)), goal=goal))
        found.add(world.truth().affordances.speed_sign)
    world.close()
    assert (limit in found) if above else found == {None}
