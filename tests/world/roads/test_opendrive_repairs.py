"""What is odd in a map is put right or left out and counted, and the rest of the map drives."""

from __future__ import annotations

import math
import re
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from caldrive.datatypes import Points
from caldrive.geometry import wrap_angle
from caldrive.world.roads.opendrive_repairs import CAR_LANES, mend, strip_unused
from caldrive.world.roads.reference_line import pose_on_line
from caldrive.world.roads.sumo_reader import read_roads
from caldrive.world.roads.towns import load_roads
from tests.maps import lane, lanes, link, road, straight, write_junction_map, write_map, write_roads

needs_netconvert = pytest.mark.skipif(
    not pytest.importorskip("importlib.util").find_spec("sumo"), reason="netconvert comes with the extra opendrive"
)
CLOSED = (
    "walking",
    "sidewalk",
    "biking",
    "parking",
    "tram",
    "roadWorks",
    "special2",
    "bus",
    "taxi",
    "HOV",
    "restricted",
)


def tree(path: Path) -> ET.Element:
    return ET.fromstring(path.read_text())


def piece(shape: str, length: float) -> ET.Element:
    return tree_of(f'<geometry s="0" x="1" y="2" hdg="0.3" length="{length}">{shape}</geometry>')


def tree_of(geometry: str) -> ET.Element:
    return ET.fromstring(f"<OpenDRIVE>{road(1, geometry)}</OpenDRIVE>")


SPIRALS = [(0.05, 0.05), (0.069, 0.069 + 1e-6), (0.069, 0.069 + 1e-15), (-4.9e-10, -5e-10), (1e-9, -5e-10), (0, 0)]


@pytest.mark.parametrize(("first", "last"), SPIRALS)
def test_a_spiral_that_is_nearly_an_arc_or_a_line_becomes_one_without_moving(first: float, last: float) -> None:
    root = piece(f'<spiral curvStart="{first!r}" curvEnd="{last!r}"/>', 12.0)
    before = pose_on_line(root[0], 12.0)
    assert not mend(root)
    shape = root[0].find("planView/geometry/*")
    assert shape is not None
    assert shape.tag == ("arc" if first > 1e-3 else "line")
    after = pose_on_line(root[0], 12.0)
    assert math.hypot(after.x - before.x, after.y - before.y) < 2e-3
    assert abs(wrap_angle(after.heading - before.heading)) < 1e-3


@pytest.mark.parametrize(("first", "last", "length"), [(0.0, 0.01, 40.0), (-0.1, 0.1, 30.0), (0.05, 0.06, 80.0)])
def test_a_true_spiral_stays_one(first: float, last: float, length: float) -> None:
    root = piece(f'<spiral curvStart="{first}" curvEnd="{last}"/>', length)
    mend(root)
    assert root[0].find("planView/geometry/spiral") is not None


def test_a_piece_without_a_shape_is_straight_and_counted(tmp_path: Path) -> None:
    root = tree(write_map(tmp_path, '<geometry s="0" x="0" y="0" hdg="0" length="100"><userData/></geometry>'))
    assert dict(mend(root)) == {"pieces of road without a shape, which are straight now": 1}
    assert pose_on_line(root[1], 60.0).x == pytest.approx(60)


def test_links_connections_and_roads_that_lead_nowhere_are_left_out(tmp_path: Path) -> None:
    path = write_junction_map(tmp_path)
    more = road(7, straight(0, 90, 0, 50), links=link("successor", "road", 99, "start")) + '<road id="8" length="9"/>'
    lost = '<connection id="9" incomingRoad="99" connectingRoad="3" contactPoint="start"/></junction>'
    path.write_text(path.read_text().replace("</junction>", lost).replace("</OpenDRIVE>", f"{more}</OpenDRIVE>"))
    assert dict(mend(tree(path))) == {
        "roads without a line or lanes": 1, "links to roads that are not there": 1,
        "connections of roads that are not there": 1,
    }  # fmt: skip


def test_nothing_of_a_sound_map_is_counted(tmp_path: Path) -> None:
    assert not mend(tree(write_junction_map(tmp_path)))


def test_signals_objects_and_the_header_do_not_reach_netconvert(tmp_path: Path) -> None:
    root = tree(
        write_map(tmp_path, signals='<signal id="1"/>', objects='<object id="1"><repeat distance="0"/></object>')
    )
    strip_unused(root)
    assert {element.tag for element in root.iter()} >= {"road", "geometry", "lane"}
    assert not {"signals", "objects", "header"} & {element.tag for element in root.iter()}


SPEEDS = {"max='40' unit='km/h'": 40, "max='25' unit='mph'": 40.2336, "max='10' unit='m/s'": 36, "max='10'": 36}


@needs_netconvert
@pytest.mark.parametrize("words", SPEEDS)
def test_the_limit_of_a_road_is_that_of_its_lanes(words: str, tmp_path: Path) -> None:
    path = write_map(tmp_path)
    path.write_text(
        path.read_text().replace("<planView>", f'<type s="0" type="town"><speed {words}/></type><planView>')
    )
    assert [lane.limit for lane in load_roads(str(path)).driveable] == pytest.approx([SPEEDS[words]] * 2, abs=0.05)


@needs_netconvert
def test_the_limit_of_a_lane_goes_before_that_of_its_road_and_no_limit_is_none(tmp_path: Path) -> None:
    own = '<speed sOffset="0" max="90" unit="km/h"/>'
    geometry, kinds = straight(0, 0, 0, 200), '<type s="0" type="town"><speed max="{}" unit="km/h"/></type>'
    part = road(1, geometry, lanes(lane(-1, more=own), lane(1)))
    for limit, wanted in (("60", [90, 60]), ("no limit", [90, 50])):
        path = write_roads(tmp_path, part.replace("<planView>", kinds.format(limit) + "<planView>"), name=limit[:2])
        assert [lane.limit for lane in load_roads(str(path)).driveable] == pytest.approx(wanted, abs=0.1)


@needs_netconvert
def test_a_limit_that_changes_along_a_road_changes_along_its_lanes(tmp_path: Path) -> None:
    kinds = "".join(f'<type s="{s}" type="town"><speed max="{v}" unit="km/h"/></type>' for s, v in ((0, 30), (120, 60)))
    path = write_roads(tmp_path, road(1, straight(0, 0, 0, 200)).replace("<planView>", f"{kinds}<planView>"))
    roads = load_roads(str(path))
    for x, limit in ((60, 30), (160, 60)):
        found = [
            lane for lane in roads.driveable if abs(lane.line.project(x, -2).left) < 0.1 and covers(lane.line.points, x)
        ]
        assert [round(lane.limit) for lane in found] == [limit]


def covers(points: Points, x: float) -> bool:
    return bool(points[:, 0].min() < x < points[:, 0].max())


@needs_netconvert
@pytest.mark.parametrize("kind", sorted({*CAR_LANES, *CLOSED, "whatever"}))
def test_cars_drive_on_what_is_for_cars_alone(kind: str, tmp_path: Path) -> None:
    path = write_roads(tmp_path, road(1, straight(0, 0, 0, 100), lanes(lane(-1) + lane(-2, kind, width=3))))
    assert len(load_roads(str(path)).driveable) == (2 if kind in CAR_LANES else 1)


FENCE = '<objects><object id="1" s="1" t="1"><repeat s="0" length="9" distance="-1"/></object></objects>'
BARE = '<elevationProfile><elevation s="0"/></elevationProfile>'
ODD = {
    "a namespace": lambda text: text.replace("<OpenDRIVE>", '<OpenDRIVE xmlns="http://code.asam.net/simulation">'),
    "a centre lane without a type": lambda text: text.replace('id="0" type="none"', 'id="0"'),
    "a signal with nothing": lambda text: text.replace("</signals>", "<signal/></signals>"),
    "an object repeated without end": lambda text: text.replace("<signals>", f"{FENCE}<signals>"),
    "a bare elevation": lambda text: text.replace("<lanes>", f"{BARE}<lanes>"),
    "a width without coefficients": lambda text: text.replace(' b="0" c="0" d="0"', ""),
    "a section without a start": lambda text: text.replace('<laneSection s="0">', "<laneSection>"),
    "a piece without a start": lambda text: text.replace('<geometry s="0" x="0" y="0"', "<geometry"),
    "no length": lambda text: text.replace('<road name="" length="100.0"', "<road"),
    "an empty level": lambda text: text.replace('level="false"', 'level=""'),
    "a lane without a number": lambda text: text.replace("</right>", '<lane type="driving"/></right>'),
    "no junction": lambda text: text.replace(' junction="-1"', "", 1),
    "an unknown projection": lambda text: text.replace("</header>", "<geoReference>+proj=moon</geoReference></header>"),
    "a lane without width": lambda text: text.replace("</right>", f"{lane(-2, width=0)}</right>"),
}  # fmt: skip


@needs_netconvert
@pytest.mark.parametrize("case", ODD)
def test_a_map_with_something_odd_loads(case: str, tmp_path: Path) -> None:
    path = write_roads(tmp_path, road(1, straight(0, 0, 0, 100)))
    text = path.read_text()
    path.write_text(ODD[case](text))
    assert path.read_text() != text
    assert len(load_roads(str(path)).driveable) == 2


@needs_netconvert
@pytest.mark.parametrize("contact", ["start", "end"])
def test_a_direct_junction_joins_its_roads(contact: str, tmp_path: Path) -> None:
    """Road 1 goes on as road 2, and its right lane also as road 3; both may be drawn against the traffic."""
    pair, single = lanes(lane(-1) + lane(-2)), lanes(lane(-1))
    turned = contact == "end"
    ways = []
    for number, y, length in ((2, 0, 100), (3, -4, 100)):
        own = lane(-1) + lane(-2) if number == 2 else lane(-1)
        if turned:  # the same traffic, on the left of a line that is drawn towards the junction
            own = re.sub(r'id="-(\d)"', r'id="\1"', own)
            geometry, of_lanes = straight(200, y, math.pi, length), lanes("", own).replace("<right></right>", "")
        else:
            geometry, of_lanes = straight(100, y, 0, length), pair if number == 2 else single
        ways.append(road(number, geometry, of_lanes, link("successor" if turned else "predecessor", "junction", 9)))
    sign = "" if turned else "-"
    connections = "".join(
        f'<connection id="1" incomingRoad="1" linkedRoad="{number}" contactPoint="{contact}">{pairs}</connection>'
        for number, pairs in (
            (2, f'<laneLink from="-1" to="{sign}1"/><laneLink from="-2" to="{sign}2"/>'),
            (3, f'<laneLink from="-2" to="{sign}1"/>'),
        )
    )
    first = road(1, straight(0, 0, 0, 100), pair, link("successor", "junction", 9))
    path = write_roads(tmp_path, first, *ways, f'<junction id="9" name="" type="direct">{connections}</junction>')
    roads = load_roads(str(path))

    def reached(id: str) -> set[str]:
        ways = (roads.lanes[via] for via in roads.lanes[id].successors)
        return {onward for way in ways for onward in (way.successors if way.internal else (way.id,))}

    left, right = ("2_1", "2_0") if turned else ("-2_1", "-2_0")
    assert reached("-1_1") == {left}
    assert reached("-1_0") == {right, f"{sign}3_0"}
    assert all(roads.lanes[via].turn is not None for via in roads.lanes["-1_0"].successors), "a fork asks for a command"


def test_roads_without_a_lane_for_cars_are_still_refused(tmp_path: Path) -> None:
    path = write_roads(tmp_path, road(1, straight(0, 0, 0, 100), lanes(lane(-1, "sidewalk"))))
    with pytest.raises(ValueError, match=r"map\.xodr cannot be read \(it has no lane"):
        load_roads(str(path))


def test_a_network_is_read_without_a_map(town02: object) -> None:
    roads = load_roads("town02")
    again = read_roads("town02", roads.network, "town02")
    assert (again.offset, again.dropped, again.is_flat) == ((0.0, 0.0), (), True)
