"""Maps that a server has: those of OpenDRIVE files go out as the world has them."""

from __future__ import annotations

from pathlib import Path

import pytest

from caldrive.carla_bridge.server.maps import Maps, opendrive, signal_ids
from caldrive.carla_bridge.server.settings import ServerSettings
from caldrive.carla_bridge.server.wire import Refusal
from caldrive.commands.serve_carla import make_server
from caldrive.world.roads.towns import load_roads
from tests.carla_bridge.server.wire_client import free_port
from tests.maps import light_at, sign_at, write_junction_map, write_map
from tests.world.roads.test_towns import needs_netconvert

HILL = '<elevationProfile><elevation s="0" a="7.5" b="0.1" c="0" d="0"/></elevationProfile><lanes>'


@needs_netconvert
def test_a_hilly_map_goes_out_as_flat_as_the_world_is(tmp_path: Path) -> None:
    path = write_map(tmp_path, signals=sign_at(50))
    path.write_text(path.read_text().replace("<lanes>", HILL))
    sent = opendrive(str(path), load_roads(str(path)))
    assert "elevation" not in sent
    assert "<signal " in sent


@needs_netconvert
def test_a_map_that_would_have_to_be_moved_is_refused(tmp_path: Path) -> None:
    arc = '<geometry s="0" x="500007" y="3" hdg="0.4" length="200"><arc curvature="0.01"/></geometry>'
    path = write_map(tmp_path, arc, length=200)
    with pytest.raises(ValueError, match="wanted one within 5 km"):
        make_server(ServerSettings(town=str(path), port=free_port()))


@needs_netconvert
def test_lights_and_signs_of_a_file_keep_its_ids(tmp_path: Path) -> None:
    path = write_junction_map(tmp_path, {1: light_at(95.0, id=71) + sign_at(50.0)})
    roads = load_roads(str(path))
    found = signal_ids(str(path), roads)
    assert set(found.lights.values()) - {""} == {"71"}
    assert len(found.signs) == 1


def test_a_map_is_found_by_carlas_names_for_it(tmp_path: Path) -> None:
    (tmp_path / "Town07.xodr").touch()
    maps = Maps(tmp_path)
    for name in ("Town07", "Carla/Maps/Town07", "/Game/Carla/Maps/Town07_Opt"):
        assert maps.town(name) == str(tmp_path / "Town07.xodr")
    assert maps.town("town01") == "town01"
    with pytest.raises(Refusal, match="found no map 'Town12'"):
        maps.town("Town12")
    with pytest.raises(FileNotFoundError, match="--maps"):
        Maps(tmp_path / "gone")
