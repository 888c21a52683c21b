"""OpenDRIVE: signs and lights are for the traffic that the file names; broken files say so."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from scipy.special import fresnel

from caldrive.datatypes import Pose
from caldrive.geometry import moved, wrap_angle
from caldrive.world.roads import opendrive
from caldrive.world.roads.opendrive_signals import MapSign, Signals
from tests.maps import LANES, light_at, road, sign_at, straight, write_junction_map, write_map, write_roads

ROADRUNNER = '<userData><vectorScene program="RoadRunner"/></userData>'


def read(path: Path) -> Signals:
    return opendrive.read_map(path.read_bytes()).signals


def signs(path: Path) -> tuple[MapSign, ...]:
    return read(path).signs


def assert_pose(pose: Pose, wanted: Pose) -> None:
    assert (pose.x, pose.y) == pytest.approx((wanted.x, wanted.y), abs=0.01)
    assert abs(wrap_angle(pose.heading - wanted.heading)) < 1e-3


def test_a_sign_right_of_a_straight_road_is_for_the_traffic_along_it(tmp_path: Path) -> None:
    (sign,) = signs(write_map(tmp_path, signals=sign_at(30)))
    assert (sign.limit, sign.approach) == (60, ("1", True))
    assert_pose(sign.foot, Pose(30, -5, 0))
    assert_pose(sign.at, Pose(30, 0, 0))


@pytest.mark.parametrize(
    ("t", "more", "forward"),
    [
        (-5, "", True), (5, "", False), (-5, 'orientation="none"', True), (5, 'orientation="none"', False),
        (5, 'orientation="+"', True), (-5, 'orientation="-"', False), (5, 'orientation="+" hOffset="0"', True),
        (-5, 'orientation="+" hOffset="3.14159"', True), (5, 'orientation="-" hOffset="1.3"', False),
    ],
)  # fmt: skip
def test_a_sign_is_for_those_that_its_orientation_names_and_else_stands_on_their_right(
    t: float, more: str, forward: bool, tmp_path: Path
) -> None:
    (sign,) = signs(write_map(tmp_path, signals=sign_at(30, t=t, more=more)))
    assert sign.approach == ("1", forward)
    assert_pose(sign.foot, Pose(30, t, 0 if forward else math.pi))


@pytest.mark.parametrize(("lanes", "forward"), [("-1 -1", True), ("1 2", False), ("-2 -1", True), ("0 0", False)])
def test_the_lanes_that_a_sign_names_go_before_its_orientation(lanes: str, forward: bool, tmp_path: Path) -> None:
    first, last = lanes.split()
    sign = sign_at(30, more='orientation="-"').replace(
        "/>", f'><validity fromLane="{first}" toLane="{last}"/></signal>'
    )
    assert signs(write_map(tmp_path, signals=sign))[0].approach == ("1", forward)


@pytest.mark.parametrize(("t", "orientation", "forward"), [(-5, "-", True), (5, "+", False)])
def test_maps_of_roadrunner_have_the_orientation_the_other_way_round(
    t: float, orientation: str, forward: bool, tmp_path: Path
) -> None:
    sign = sign_at(30, t=t, more=f'orientation="{orientation}"')
    (read_sign,) = signs(write_roads(tmp_path, road(1, straight(0, 0, 0, 100), signals=sign), header=ROADRUNNER))
    assert read_sign.approach == ("1", forward)


def test_an_object_named_speed_is_a_sign_as_in_carla(tmp_path: Path) -> None:
    thing = '<object id="1" name="Speed_30" s="40" t="-4.3" hdg="0.05" orientation="none" type="-1"/>'
    (sign,) = signs(write_map(tmp_path, objects=thing))
    assert sign.limit == 30
    assert_pose(sign.foot, Pose(40, -4.3, 0))


LIMITS = {  # what stands on a sign: the limit that is shown, None where it is no sign or none of ours
    'type="274" value="30"': 30, 'type="274" value="30.0000001"': 30, 'type="274" value="50"': 30,
    'type="274" value="120"': 90, 'type="274" value="20"': None, 'type="274" value="30" unit="mph"': 30,
    'type="274" value="18" unit="m/s"': 60, 'type="274" subtype="30" value="-1" country="DE"': 30,
    'type="274" subtype="53"': 30, 'type="274-56" value="-1"': 60, 'type="274" subtype="60"': 60,
    'type="274" subtype="60" countryRevision="2013"': 90, 'type="274"': None, 'type="274.1" subtype="-1"': 30,
    'type="R2-1" value="40" country="US"': 60, 'type="R2-1" value="60" unit="km/h"': 60,
    'type="maxspeed" value="60" country="OpenDRIVE"': 60, 'type="maxSpeed" value="90"': 90,
    'type="206" value="30"': None, 'name="Sign_Speed_60" type="x"': 60, 'type="274.2" value="30"': None,
}  # fmt: skip


@pytest.mark.parametrize("words", LIMITS)
def test_a_sign_shows_the_highest_limit_of_ours_that_keeps_to_its_own(words: str, tmp_path: Path) -> None:
    found = signs(write_map(tmp_path, signals=f'<signal id="1" s="9" t="-5" orientation="+" {words}/>'))
    assert [sign.limit for sign in found] == [limit for limit in [LIMITS[words]] if limit is not None]


def test_what_is_left_out_is_counted(tmp_path: Path) -> None:
    things = sign_at(150) + sign_at(20, limit=10) + '<signal id="3" s="5" t="-5"/>' + light_at(50) + sign_at(-3)
    read_map = opendrive.read_map(write_map(tmp_path, signals=things).read_bytes())
    assert read_map.signals.signs == ()
    assert dict(read_map.dropped) == {
        "signals beyond the end of their road": 2, "speed signs without a limit of 30 km/h or more": 1,
        "signals without a type": 1, "traffic lights at no junction": 1,
    }  # fmt: skip


def test_a_sign_that_stands_in_the_file_twice_is_one_sign(tmp_path: Path) -> None:
    assert len(signs(write_map(tmp_path, signals=sign_at(30) + sign_at(30.1) + sign_at(60)))) == 2


LIGHTS = {
    "at the stop line": ({1: light_at(99)}, ("1", True)),
    "over the lane": ({1: light_at(97, t=-2)}, ("1", True)),
    "on the left": ({1: light_at(99, t=5)}, ("1", True)),
    "on the far side": ({2: light_at(5)}, ("1", True)),
    "in the junction": ({3: light_at(10)}, ("1", True)),
    "two": ({1: light_at(99) + light_at(99, 5, id=8)}, ("1", True)),
    "named by a road inside": (
        {2: light_at(5), 5: '<signalReference id="9" s="1" t="0" orientation="+"/>'},
        ("4", True),
    ),
    "with a part of the number": ({4: light_at(99).replace("1000001", "1000011.1")}, ("4", True)),
}


@pytest.mark.parametrize("case", LIGHTS)
def test_a_light_is_for_those_who_come_to_the_junction(case: str, tmp_path: Path) -> None:
    things, approach = LIGHTS[case]
    found = read(write_junction_map(tmp_path, things))
    assert list(found.lights) == [approach]
    assert found.junctions == {"10"}
    assert not found.dropped


@pytest.mark.parametrize(
    "signals", [{2: light_at(100)}, {1: light_at(40)}, {2: light_at(190)}], ids=["behind", "before", "nowhere"]
)
def test_a_light_far_from_every_junction_is_left_out(signals: dict[int, str], tmp_path: Path) -> None:
    found = read(write_junction_map(tmp_path, signals))
    assert (found.lights, found.dropped["traffic lights at no junction"]) == ({}, 1)


@pytest.mark.parametrize("kind", ["1000002", "1000013", "206"])
def test_lights_for_people_and_other_signals_are_no_lights(kind: str, tmp_path: Path) -> None:
    found = read(write_junction_map(tmp_path, {1: light_at(99).replace("1000001", kind)}))
    assert (found.lights, dict(found.dropped)) == ({}, {})


def test_a_sign_follows_an_arc_even_behind_the_editors_own_data(tmp_path: Path) -> None:
    arc = '<geometry s="0" x="3" y="4" hdg="0.5" length="60"><userData code="a"/><arc curvature="0.02"/></geometry>'
    (sign,) = signs(write_map(tmp_path, arc, sign_at(40)))
    end = moved(Pose(3, 4, 0.5), math.sin(0.8) / 0.02, (1 - math.cos(0.8)) / 0.02, 0.8)
    assert_pose(sign.foot, moved(end, left=-5))


def test_a_sign_follows_a_spiral(tmp_path: Path) -> None:
    spiral = '<geometry s="0" x="3" y="4" hdg="0.5" length="80"><spiral curvStart="0" curvEnd="-0.03"/></geometry>'
    (sign,) = signs(write_map(tmp_path, spiral, sign_at(60)))
    scale = math.sqrt(math.pi * 80 / 0.03)  # Euler's spiral: the Fresnel integrals give its points
    y, x = (scale * float(part) for part in fresnel(60 / scale))
    assert_pose(sign.foot, moved(moved(Pose(3, 4, 0.5), x, -y, -(60**2) * 0.03 / 160), left=-5))


def test_a_sign_follows_a_cubic(tmp_path: Path) -> None:
    cubic = '<geometry s="0" x="3" y="4" hdg="0.5" length="90"><poly3 a="0" b="0.75" c="0" d="0"/></geometry>'
    (sign,) = signs(write_map(tmp_path, cubic, sign_at(50)))  # a straight line, 3 : 4 : 5
    assert_pose(sign.foot, moved(moved(Pose(3, 4, 0.5), 40, 30, math.atan(0.75)), left=-5))


@pytest.mark.parametrize(("of", "p"), [("arcLength", 25.0), ("normalized", 0.5)])
def test_a_sign_follows_a_parametric_cubic(of: str, p: float, tmp_path: Path) -> None:
    cubic = f"""<geometry s="0" x="3" y="4" hdg="0.5" length="50"><paramPoly3 aU="0" bU="1.5" cU="0.1" dU="0" aV="0"
        bV="0" cV="0.02" dV="0.003" pRange="{of}"/></geometry>"""
    (sign,) = signs(write_map(tmp_path, cubic, sign_at(25), length=50))
    u, v = 1.5 * p + 0.1 * p**2, 0.02 * p**2 + 0.003 * p**3
    slope = math.atan2(0.04 * p + 0.009 * p**2, 1.5 + 0.2 * p)
    assert_pose(sign.foot, moved(moved(Pose(3, 4, 0.5), u, v, slope), left=-5))


def test_a_sign_stands_on_the_right_piece_of_a_road_of_several(tmp_path: Path) -> None:
    pieces = """<geometry s="0" x="0" y="0" hdg="0" length="50"><line/></geometry>
        <geometry s="50" x="50" y="0" hdg="1.5707963" length="50"><line/></geometry>"""
    (sign,) = signs(write_map(tmp_path, pieces, sign_at(70)))
    assert_pose(sign.foot, Pose(55, 20, math.pi / 2))


@pytest.mark.parametrize(("x", "moved_by"), [(0, 0), (4000, 0), (-500_020, -500_000), (1e7, 1e7)])
def test_a_map_far_away_is_moved_by_whole_kilometres(x: float, moved_by: float, tmp_path: Path) -> None:
    near = straight(x, 0.25, 0.3, 100)
    read_map = opendrive.read_map(write_roads(tmp_path, road(1, near, signals=sign_at(30))).read_bytes())
    assert list(read_map.offset) == [moved_by, 0]
    assert_pose(read_map.signals.signs[0].at, moved(Pose(x - moved_by, 0.25, 0.3), forward=30))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "it is no XML: no element found"),
        (b"<OpenDRIVE><road>", "it is no XML: no element found"),
        (b"a drawing", "it is no XML: syntax error"),
        (b"<osm/>", "it is <osm>, not <OpenDRIVE>"),
    ],
    ids=["empty", "cut off", "no xml", "another format"],
)
def test_a_file_that_is_no_map_says_so(content: bytes, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        opendrive.read_map(content)


@pytest.mark.parametrize(
    ("s", "message"), [("here", "s='here', which is no number"), ("nan", "s=nan"), ("inf", "s=inf")]
)
def test_a_number_that_is_none_says_so(s: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=message):
        read(write_map(tmp_path, signals=f'<signal id="7" s="{s}" t="-5" type="274" value="30"/>'))


def test_a_map_without_roads_has_no_furniture() -> None:
    found = opendrive.read_map(b"<OpenDRIVE/>").signals
    assert (found.signs, found.lights) == ((), {})


@pytest.mark.parametrize("length", ["1e308", "-1", "nan", "100001"])
def test_a_length_that_no_road_has_says_so(length: str, tmp_path: Path) -> None:
    path = write_map(tmp_path)
    path.write_text(path.read_text().replace('hdg="0" length="100"', f'hdg="0" length="{length}"'))
    with pytest.raises(ValueError, match=f"<geometry> .*length={length}"):
        read(path)


def test_a_road_driven_on_the_left_is_refused(tmp_path: Path) -> None:
    path = write_roads(tmp_path, road(1, straight(0, 0, 0, 100), LANES, attributes='junction="-1" rule="LHT"'))
    with pytest.raises(ValueError, match=r'its road 1 is driven on the left \(rule="LHT"\)'):
        read(path)
