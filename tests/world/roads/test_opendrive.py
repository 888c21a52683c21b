"""OpenDRIVE: signs and posts stand where the file says, on every kind of reference line; broken files say so."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from scipy.special import fresnel

from caldrive.datatypes import Pose, Sign
from caldrive.geometry import moved, wrap_angle
from caldrive.world.roads import opendrive
from tests.maps import sign_at, write_map


def read_furniture(path: Path) -> tuple[list[Pose], list[Sign]]:
    return opendrive.read_furniture(path.read_bytes())


def assert_pose(pose: Pose, wanted: Pose) -> None:
    assert (pose.x, pose.y) == pytest.approx((wanted.x, wanted.y), abs=0.01)
    assert abs(wrap_angle(pose.heading - wanted.heading)) < 1e-3


def test_a_sign_right_of_a_straight_road_faces_the_traffic_along_it(tmp_path: Path) -> None:
    posts, (sign,) = read_furniture(write_map(tmp_path, signals=sign_at(30)))
    assert posts == []
    assert sign.limit == 60
    assert_pose(sign.pose, Pose(30, -5, 0))


@pytest.mark.parametrize(
    "more", ["", 'hOffset="3.14159265"', 'hOffset="0" orientation="-"'], ids=["silent", "carla", "standard"]
)
def test_a_sign_left_of_the_reference_line_faces_the_traffic_against_it(more: str, tmp_path: Path) -> None:
    _, (sign,) = read_furniture(write_map(tmp_path, signals=sign_at(30, t=5.0, more=more)))
    assert_pose(sign.pose, Pose(30, 5, math.pi))


def test_an_object_named_speed_is_a_sign_as_in_carla(tmp_path: Path) -> None:
    thing = '<object id="1" name="Speed_30" s="40" t="-4.3" hdg="0.05" orientation="-" type="-1"/>'
    _, (sign,) = read_furniture(write_map(tmp_path, objects=thing))
    assert sign.limit == 30
    assert_pose(sign.pose, Pose(40, -4.3, 0.05))


def test_a_three_lamp_signal_is_a_post_and_no_sign(tmp_path: Path) -> None:
    light = '<signal id="1" name="Signal_3Light" s="90" t="-4.5" hOffset="0" type="1000001" value="-1"/>'
    (post,), signs = read_furniture(write_map(tmp_path, signals=light))
    assert signs == []
    assert_pose(post, Pose(90, -4.5, 0))


def test_other_signs_and_other_limits_are_left_out(tmp_path: Path) -> None:
    things = sign_at(10, limit=50) + '<signal s="20" t="-5" type="206" value="30"/><signal s="1" t="1" type="274"/>'
    bench = '<object id="1" name="Bench_30" s="40" t="-4.3"/>'
    assert read_furniture(write_map(tmp_path, signals=things, objects=bench)) == ([], [])


def test_a_sign_that_stands_in_the_file_twice_is_one_sign(tmp_path: Path) -> None:
    _, signs = read_furniture(write_map(tmp_path, signals=sign_at(30) + sign_at(30.1) + sign_at(60)))
    assert len(signs) == 2


def test_a_sign_follows_an_arc(tmp_path: Path) -> None:
    arc = '<geometry s="0" x="3" y="4" hdg="0.5" length="60"><arc curvature="0.02"/></geometry>'
    _, (sign,) = read_furniture(write_map(tmp_path, arc, sign_at(40)))
    end = moved(Pose(3, 4, 0.5), math.sin(0.8) / 0.02, (1 - math.cos(0.8)) / 0.02, 0.8)
    assert_pose(sign.pose, moved(end, left=-5))


def test_a_sign_follows_a_spiral(tmp_path: Path) -> None:
    spiral = '<geometry s="0" x="3" y="4" hdg="0.5" length="80"><spiral curvStart="0" curvEnd="-0.03"/></geometry>'
    _, (sign,) = read_furniture(write_map(tmp_path, spiral, sign_at(60)))
    scale = math.sqrt(math.pi * 80 / 0.03)  # Euler's spiral: the Fresnel integrals give its points
    y, x = (scale * float(part) for part in fresnel(60 / scale))
    assert_pose(sign.pose, moved(moved(Pose(3, 4, 0.5), x, -y, -(60**2) * 0.03 / 160), left=-5))


@pytest.mark.parametrize(("of", "p"), [("arcLength", 25.0), ("normalized", 0.5)])
def test_a_sign_follows_a_parametric_cubic(of: str, p: float, tmp_path: Path) -> None:
    cubic = f"""<geometry s="0" x="3" y="4" hdg="0.5" length="50"><paramPoly3 aU="0" bU="1.5" cU="0.1" dU="0" aV="0"
        bV="0" cV="0.02" dV="0.003" pRange="{of}"/></geometry>"""
    _, (sign,) = read_furniture(write_map(tmp_path, cubic, sign_at(25)))
    u, v = 1.5 * p + 0.1 * p**2, 0.02 * p**2 + 0.003 * p**3
    slope = math.atan2(0.04 * p + 0.009 * p**2, 1.5 + 0.2 * p)
    assert_pose(sign.pose, moved(moved(Pose(3, 4, 0.5), u, v, slope), left=-5))


def test_a_sign_stands_on_the_right_piece_of_a_road_of_several(tmp_path: Path) -> None:
    pieces = """<geometry s="0" x="0" y="0" hdg="0" length="50"><line/></geometry>
        <geometry s="50" x="50" y="0" hdg="1.5707963" length="50"><line/></geometry>"""
    _, (sign,) = read_furniture(write_map(tmp_path, pieces, sign_at(70)))
    assert_pose(sign.pose, Pose(55, 20, math.pi / 2))


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
        opendrive.read_furniture(content)


@pytest.mark.parametrize(
    ("geometry", "message"),
    [("", "road 1 has no <geometry> at s=5"), ('<geometry s="0" x="0" y="0" hdg="0" length="9"/>', "is no line")],
    ids=["none", "bare"],
)
def test_a_road_without_a_reference_line_has_no_place_for_a_sign(geometry: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=message):
        read_furniture(write_map(tmp_path, geometry, sign_at(5)))


@pytest.mark.parametrize("s", ["here", "nan", "inf"])
def test_a_number_that_is_none_says_so(s: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=f"here|s={s}"):
        read_furniture(write_map(tmp_path, signals=f'<signal id="7" s="{s}" t="-5" type="274" value="30"/>'))


def test_a_map_without_roads_has_no_furniture(tmp_path: Path) -> None:
    path = tmp_path / "empty.xodr"
    path.write_text("<OpenDRIVE/>")
    assert read_furniture(path) == ([], [])


@pytest.mark.parametrize("length", ["1e308", "-1", "nan", "100001"])
def test_a_length_that_no_road_has_says_so(length: str, tmp_path: Path) -> None:
    path = write_map(tmp_path)
    path.write_text(path.read_text().replace('hdg="0" length="100"', f'hdg="0" length="{length}"'))
    with pytest.raises(ValueError, match=f"<geometry> .*length={length}"):
        read_furniture(path)
