"""Generated towns: sound, the same from the same seed, and the package's own without netconvert."""

from __future__ import annotations

import math
import re
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest
import shapely

from caldrive.datatypes import Command
from caldrive.scenarios import HELD_OUT_FROM, GeneratedTown, generated_town
from caldrive.world.roads import netconvert, packed_networks
from caldrive.world.roads.generated import draw_town, load_generated
from caldrive.world.roads.network import LightPost, RoadNetwork, rings
from caldrive.world.roads.packed_networks import pack, packed_names, packed_network
from caldrive.world.roads.road_checks import faults
from caldrive.world.roads.towns import load_roads
from caldrive.world.traffic.sidewalks import find_sidewalks

needs_netconvert = pytest.mark.skipif(
    not pytest.importorskip("importlib.util").find_spec("sumo"), reason="netconvert comes with the extra opendrive"
)


@pytest.fixture(scope="module")
def wide() -> RoadNetwork:
    """A town with two lanes a side and a roundabout."""
    pytest.importorskip("sumo", reason="netconvert comes with the extra opendrive")
    return draw_town(GeneratedTown("random-wide", 1003))


@pytest.mark.parametrize("town", ["random:7", "random-wide:1000000000"])
def test_a_town_has_one_name(town: str) -> None:
    generated = generated_town(town)
    assert generated is not None
    assert generated.name == town


@pytest.mark.parametrize("seed", ["", "-1", "07", "1.5", "mars", "7 ", "99999999999", "٣"])
def test_a_seed_that_cannot_be_says_what_to_type(seed: str) -> None:
    with pytest.raises(ValueError, match=r"wanted a seed from 0 to .*type --town random:7"):
        load_roads(f"random:{seed}")


def test_a_town_that_is_no_generated_one_is_left_to_others() -> None:
    assert generated_town("town01") is generated_town("random.xodr") is generated_town("C:random") is None


@needs_netconvert
@pytest.mark.parametrize("seed", [1000, 1001, 1003])
def test_a_town_is_sound_and_drawn_the_same_again(seed: int) -> None:
    first, again = (draw_town(GeneratedTown("random", seed)) for _ in range(2))
    assert list(faults(first)) == []
    assert first.network.read_bytes() == again.network.read_bytes()
    assert {sign.limit for sign in first.signs} >= {30, 60}
    assert first.posts


@needs_netconvert
def test_a_town_that_fails_a_check_is_drawn_again(monkeypatch: pytest.MonkeyPatch) -> None:
    town, looked = GeneratedTown("random", 1000), list[RoadNetwork]()
    sound = draw_town(town)

    def fails_once(roads: RoadNetwork) -> object:
        looked.append(roads)
        return iter(["too dull"] if len(looked) == 1 else [])

    monkeypatch.setattr("caldrive.world.roads.road_checks.faults", fails_once)
    assert draw_town(town).network != sound.network
    assert looked[0].network == sound.network


def test_without_netconvert_a_seed_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "sumo", None)
    with pytest.raises(
        RuntimeError, match=r"found no netconvert, .* of a seed: type pip install 'caldrive\[opendrive\]'"
    ):
        draw_town(GeneratedTown("random", 7))


def test_the_package_has_the_unseen_towns_and_needs_no_netconvert_for_them(monkeypatch: pytest.MonkeyPatch) -> None:
    assert len(packed_names()) == 140
    assert all(int(name.partition(":")[2]) >= HELD_OUT_FROM for name in packed_names())
    monkeypatch.setattr(netconvert, "netconvert_binary", lambda: pytest.fail("looked for netconvert"))
    roads = load_generated(GeneratedTown("random", HELD_OUT_FROM))
    assert list(faults(roads)) == []


@needs_netconvert
@pytest.mark.parametrize("town", [GeneratedTown("random", HELD_OUT_FROM + 7), GeneratedTown("random-wide", 9_500_003)])
def test_a_town_drawn_anew_gives_the_bytes_that_ship(town: GeneratedTown) -> None:
    assert draw_town(town).network.read_bytes() == packed_network(town.name)


def test_an_archive_gives_back_what_was_packed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    networks = {"b": b'<lane id="x" shape="1.25,-3.00 0.00,-0.07 120.01,7.10"/>', "a": b"<net>\n</net>"}
    archives = tmp_path / "first.tar.xz", tmp_path / "again.tar.xz"
    for archive in archives:
        pack(networks, archive)
    assert archives[0].read_bytes() == archives[1].read_bytes()
    monkeypatch.setattr(packed_networks, "ARCHIVE", archives[0])
    assert {name: packed_network(name) for name in networks} == networks


def test_where_two_lanes_lead_to_a_light_one_post_stands_beside_both(wide: RoadNetwork) -> None:
    sides = defaultdict[tuple[str, str], list[LightPost]](list)
    for post in wide.posts:
        sides[post.approach].append(post)
    broad = [side for side in sides.values() if len(side) > 1]
    assert broad
    for side in broad:
        assert len({post.stands_at for post in side}) == 1
        for post, aside in zip(side, (0.5, 1.5), strict=True):
            lane = wide.lanes[post.lane]
            place = lane.line.project(post.stands_at.x, post.stands_at.y)
            assert place.left == pytest.approx(-aside * lane.width - 0.5, abs=0.1)


def test_no_post_stands_on_the_road(wide: RoadNetwork) -> None:
    feet = {post.stands_at for post in wide.posts} | {sign.stands_at for sign in wide.signs}
    assert len(feet) < len(wide.posts) + len(wide.signs)
    assert not any(shapely.contains_xy(wide.roadway, foot.x, foot.y) for foot in feet)


def test_in_a_roundabout_right_leads_in_and_out_and_straight_around(wide: RoadNetwork) -> None:
    at_rings = re.compile(r":[A-E]\d[a-d]_")  # the junctions of a ring have the name of its own and a letter
    ways = [lane for id, lane in wide.lanes.items() if lane.turn is not None and at_rings.match(id)]
    assert {lane.turn for lane in ways} == {Command.RIGHT, Command.STRAIGHT}
    for lane in ways:
        turned = lane.line.headings[-1] - lane.line.headings[0]
        turned = (turned + math.pi) % math.tau - math.pi
        assert (turned < -0.6) == (lane.turn is Command.RIGHT)
    assert {lane.turn for lane in ways if lane.light is not None} == {Command.RIGHT}


def test_nobody_walks_on_the_island_of_a_roundabout(wide: RoadNetwork) -> None:
    islands = [shapely.Polygon(hole) for hole in rings(wide.roadway) if hole.length < 110]
    assert islands
    sidewalks = find_sidewalks(wide)
    walks = [sidewalks.loops.table[:, :2], *(way.end[None] for ways in sidewalks.crossings for way in ways)]
    for island in islands:
        assert not shapely.contains_xy(island, np.concatenate(walks)).any()
