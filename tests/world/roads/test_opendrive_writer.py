"""Maps that are written: what is in the file, and that our own reader makes the same town of it."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from numpy.typing import NDArray

from caldrive.geometry import moved, positions
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.roads.opendrive_writer import write_opendrive
from caldrive.world.roads.reference_line import number, pose_on_line
from caldrive.world.roads.towns import load_roads
from caldrive.world.roads.two_way_streets import Turn, find_streets

needs_netconvert = pytest.mark.skipif(
    not pytest.importorskip("importlib.util").find_spec("sumo"), reason="netconvert comes with the extra opendrive"
)


@pytest.fixture(scope="module")
def root(town02: RoadNetwork) -> ET.Element:
    """The map of town02."""
    return ET.fromstring(write_opendrive(town02))


def test_the_same_town_gives_the_same_bytes(town02: RoadNetwork) -> None:
    assert write_opendrive(town02) == write_opendrive(town02)


def test_a_number_names_one_thing(root: ET.Element) -> None:
    named = [*root.findall("road"), *root.findall("junction"), *root.findall("road/signals/signal")]
    assert len({element.get("id") for element in named}) == len(named)


def test_a_connecting_road_begins_and_ends_on_the_lanes_that_it_joins(root: ET.Element) -> None:
    roads = {road.get("id"): road for road in root.findall("road")}
    for road in (road for road in roads.values() if road.get("junction") != "-1"):
        for kind, s in (("predecessor", 0.0), ("successor", number(road, "length"))):
            link = road.find(f"link/{kind}")
            assert link is not None
            street = roads[link.get("elementId")]
            end = pose_on_line(street, number(street, "length") if link.get("contactPoint") == "end" else 0.0)
            lane = int(road.find(f"lanes/laneSection/right/lane[@id='-1']/link/{kind}").get("id"))  # type: ignore[union-attr, arg-type]
            there, here = moved(end, left=math.copysign(2.0, lane)), pose_on_line(road, s)
            assert (here.x, here.y) == pytest.approx((there.x, there.y), abs=1e-4)
            assert math.cos(here.heading - there.heading) * -math.copysign(1, lane) == pytest.approx(1, abs=1e-6)


def test_every_lane_that_is_joined_exists(root: ET.Element) -> None:
    lanes = {(road.get("id"), lane.get("id")) for road in root.findall("road") for lane in road.iter("lane")}
    for connection in root.findall("junction/connection"):
        for link in connection.findall("laneLink"):
            assert (connection.get("incomingRoad"), link.get("from")) in lanes
            assert (connection.get("connectingRoad"), link.get("to")) in lanes


def test_streets_have_sidewalks_and_right_turns_join_them(root: ET.Element) -> None:
    kinds = {True: set[tuple[str | None, ...]](), False: set[tuple[str | None, ...]]()}
    for road in root.findall("road"):
        kinds[road.get("junction") == "-1"].add(tuple(lane.get("type") for lane in road.iter("lane")))
    assert kinds[True] == {("sidewalk", "driving", "none", "driving", "sidewalk")}
    assert kinds[False] == {("none", "driving"), ("none", "driving", "sidewalk")}
    walks = [link for link in root.findall("junction/connection/laneLink") if link.get("to") == "-2"]
    assert len(walks) == 3 * len(root.findall("junction"))  # at its two corners, and along the street that goes through


def test_nobody_changes_lanes_over_the_middle(root: ET.Element) -> None:
    marks = root.findall("road[@junction='-1']/lanes/laneSection/center/lane/roadMark")
    assert {mark.get("laneChange") for mark in marks} == {"none"}
    assert {mark.get("type") for mark in marks} == {"solid", "broken"}


def test_a_town_with_hills_is_refused(town02: RoadNetwork) -> None:
    id, lane = next(iter(town02.lanes.items()))
    hilly = replace(town02, lanes=town02.lanes | {id: replace(lane, heights=np.ones(len(lane.line.points)))})
    with pytest.raises(ValueError, match="found hills in town02, wanted a flat town"):
        write_opendrive(hilly)


@needs_netconvert
@pytest.mark.parametrize("town", ["town01", "town02", "random:11"])
def test_the_reader_makes_the_same_town_of_it(town: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    roads = load_roads(town)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    (tmp_path / "map.xodr").write_bytes(write_opendrive(roads))
    again = load_roads(str(tmp_path / "map.xodr"))
    assert again.dropped == ()
    _require_same_lanes(roads, again)
    _require_same_turns(find_streets(roads)[1], find_streets(again)[1])
    _require_same_things(_lights(roads), _lights(again))
    _require_same_things(_signs(roads), _signs(again))


def _require_same_lanes(roads: RoadNetwork, again: RoadNetwork) -> None:
    for lane in roads.driveable:
        for s in np.arange(1.0, lane.line.length - 1.0, 2.0).tolist():
            here = lane.line.pose_at(s)
            found, _ = again.lane_at(here)
            assert abs(found.line.project(here.x, here.y).left) < 0.05
            assert (found.width, found.limit) == pytest.approx((lane.width, lane.limit), abs=0.1)


def _require_same_turns(turns: list[Turn], again: list[Turn]) -> None:
    ends = [
        np.array([(*turn.start.line.points[-1], *turn.end.line.points[0]) for turn in found])
        for found in (turns, again)
    ]
    apart = np.abs(ends[0][:, None] - ends[1][None]).max(-1)
    assert len(turns) == len(again)
    assert apart.min(1).max() < 0.1
    for turn, k in zip(turns, apart.argmin(1).tolist(), strict=True):
        assert again[k].inside[0].turn is turn.inside[0].turn


def _require_same_things(things: NDArray[np.float64], again: NDArray[np.float64]) -> None:
    apart = np.abs(things[:, None] - again[None]).max(-1)
    assert len(things) == len(again)
    assert max(apart.min(0).max(), apart.min(1).max()) < 0.05


def _lights(roads: RoadNetwork) -> NDArray[np.float64]:
    """Where each light stands, where it counts, and for which heading."""
    feet = [(post.stands_at.x, post.stands_at.y, math.cos(post.pose.heading)) for post in roads.posts]
    return np.column_stack((feet, positions(roads.posts)))


def _signs(roads: RoadNetwork) -> NDArray[np.float64]:
    """Where each sign stands, for which heading, and its limit."""
    rows = [(sign.stands_at.x, sign.stands_at.y, math.cos(sign.pose.heading), sign.limit) for sign in roads.signs]
    return np.array(rows, dtype=float)
