"""Towns by name or file: what cannot be loaded says in one sentence what to type; maps are converted once."""

from __future__ import annotations

import tempfile
from pathlib import Path

import pytest

from caldrive.datatypes import Pose
from caldrive.geometry import to_local
from caldrive.world.roads import netconvert, towns
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.roads.towns import load_roads
from caldrive.world.town import load_town
from tests.maps import sign_at, write_map

needs_netconvert = pytest.mark.skipif(
    not pytest.importorskip("importlib.util").find_spec("sumo"), reason="netconvert comes with the extra opendrive"
)


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache for converted maps."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path / "cache" / "caldrive"


def test_a_town_is_loaded_once(town01: RoadNetwork) -> None:
    assert load_roads("town01") is load_roads("town01")
    assert town01.name == town01.appearance == "town01"


def test_an_unknown_town_names_the_known_ones() -> None:
    with pytest.raises(
        ValueError, match=r"found town 'Paris', wanted one of town01, town02, random:SEED or an OpenDRIVE"
    ):
        load_roads("Paris")


def test_a_missing_map_names_the_file(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"found no file .*lost\.xodr, wanted an OpenDRIVE map"):
        load_roads(str(tmp_path / "lost.xodr"))


def test_a_broken_map_says_so_and_leaves_nothing_in_the_cache(cache: Path, tmp_path: Path) -> None:
    (tmp_path / "broken.xodr").write_text("<OpenDRIVE><road>")
    with pytest.raises(ValueError, match=r"broken\.xodr cannot be read \(it is no XML"):
        load_roads(str(tmp_path / "broken.xodr"))
    assert not list(cache.glob("*.xml"))


@pytest.mark.parametrize("break_it", [OverflowError, KeyError, MemoryError, RecursionError, StopIteration])
def test_whatever_goes_wrong_names_the_map(
    break_it: type[Exception], cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_: bytes) -> None:
        raise break_it("deep inside")

    monkeypatch.setattr("caldrive.world.roads.opendrive.read_map", fail)
    with pytest.raises(ValueError, match=rf"road\.xodr cannot be read \({break_it.__name__}: .*give another"):
        load_roads(str(write_map(tmp_path)))


def test_what_goes_wrong_in_the_scenery_of_a_map_names_it_too(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr("caldrive.world.town.build_scenery", fail)
    monkeypatch.setattr("caldrive.world.town.load_roads", lambda _: load_roads("town02"))
    with pytest.raises(ValueError, match=r"found that odd\.xodr cannot be read \(ZeroDivisionError"):
        load_town.__wrapped__("odd.xodr")
    with pytest.raises(ZeroDivisionError):  # in a town of ours it is a fault of the program
        load_town.__wrapped__("town02")


def test_a_file_too_large_for_a_map_is_refused_before_it_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(towns, "MOST_MEGABYTES", 1)
    with (tmp_path / "huge.xodr").open("wb") as file:
        file.truncate(10**12)  # it takes no room on the disk
    with pytest.raises(ValueError, match=r"found more than 1 MB in .*huge\.xodr"):
        load_roads(str(tmp_path / "huge.xodr"))


@needs_netconvert
def test_a_straight_road_becomes_a_town_with_two_lanes_and_its_sign(cache: Path, tmp_path: Path) -> None:
    roads = load_roads(str(write_map(tmp_path, signals=sign_at(30))))
    assert roads.name == "road"
    assert len(roads.driveable) == 2
    (sign,) = roads.signs
    assert (sign.pose.x, sign.pose.y, sign.limit) == pytest.approx((30, -5.1, 60), abs=0.05)
    lane, s = roads.lane_at(Pose(30, -2, 0))
    assert s == pytest.approx(30, abs=0.1)
    assert to_local(lane.line.pose_at(s), lane.line.points)[:, 1] == pytest.approx(0, abs=0.01)


@needs_netconvert
def test_a_map_is_converted_once(cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_map(tmp_path)
    first = load_roads(str(path))
    assert [path.name for path in cache.iterdir()] == [first.network.name]
    load_roads.cache_clear()
    monkeypatch.setattr(netconvert, "convert_opendrive", lambda *_: pytest.fail("was converted again"))
    assert load_roads(str(path)).network == first.network


@needs_netconvert
def test_another_version_of_sumo_converts_a_map_again(
    cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_map(tmp_path)
    first = load_roads(str(path))
    load_roads.cache_clear()
    monkeypatch.setattr(netconvert, "version", lambda _: "99.0")
    assert load_roads(str(path)).network != first.network


@needs_netconvert
def test_a_network_that_broke_off_is_made_again(cache: Path, tmp_path: Path) -> None:
    path = write_map(tmp_path)
    first = load_roads(str(path))
    whole = first.network.read_bytes()
    first.network.write_bytes(whole[:1000])
    load_roads.cache_clear()
    assert len(load_roads(str(path)).driveable) == 2
    assert first.network.read_bytes() == whole


def test_without_netconvert_the_message_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "sumo", None)
    with pytest.raises(RuntimeError, match=r"pip install 'caldrive\[opendrive\]'"):
        netconvert.netconvert_binary()


@needs_netconvert
def test_a_town_far_from_the_origin_is_the_same_town(tmp_path: Path) -> None:
    arc = '<geometry s="0" x="{x}" y="{y}" hdg="0.4" length="200"><arc curvature="0.01"/></geometry>'
    towns = []
    for name, (x, y) in (("near", (7.25, -3.5)), ("far", (500_007.25, 5_399_996.5))):
        (tmp_path / name).mkdir()
        path = write_map(tmp_path / name, arc.format(x=x, y=y), sign_at(100), length=200)
        towns.append(load_town(str(path)))
    near, far = towns
    assert list(far.roads.offset) == [500_000, 5_400_000]
    assert far.signs == near.signs
    assert far.scenery == near.scenery
    for lane in near.roads.driveable:
        assert (far.roads.lanes[lane.id].line.points == lane.line.points).all()
