"""The connection to a CARLA server, with a stand-in for CARLA's client."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from caldrive.carla_bridge.client import connection
from caldrive.carla_bridge.client import world as client_world
from caldrive.carla_bridge.client.connection import Connection, served_town
from caldrive.carla_bridge.client.world import CarlaWorld
from caldrive.driving.tasks import task_scenarios

SAID = "time-out of 5000ms while waiting for the simulator"


class Client:
    """CARLA's client, of a server with two maps."""

    version, is_alive = "0.9.16", True

    def __init__(self, *_: Any) -> None:
        self.world = SimpleNamespace(get_map=lambda: SimpleNamespace(name="Carla/Maps/Town01", to_opendrive=str))

    def set_timeout(self, _: float) -> None: ...

    def get_client_version(self) -> str:
        return "0.9.16"

    def get_server_version(self) -> str:
        if not self.is_alive:
            raise RuntimeError(SAID)
        return self.version

    def get_world(self) -> Any:
        return self.world

    def get_available_maps(self) -> list[str]:
        return ["/Game/Carla/Maps/Town01", "/Game/Carla/Maps/Town02"]


@pytest.fixture(autouse=True)
def library(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(connection, "carla_module", lambda: SimpleNamespace(Client=Client))


def test_a_server_of_another_version_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Client, "version", "0.9.15-dirty")
    with pytest.raises(RuntimeError, match=r"^found CARLA 0\.9\.15-dirty at here:2000, wanted 0\.9\.16"):
        Connection("here", 2000)


def test_a_server_that_does_not_answer_is_a_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Client, "is_alive", False)
    with pytest.raises(RuntimeError, match=r"^found no answer from CARLA at here:2000, wanted a server there: start"):
        Connection("here", 2000)


def test_a_map_that_the_server_has_not_is_refused() -> None:
    with pytest.raises(ValueError, match=r"^found no map 'Town99' on the server, wanted one of Town01, Town02"):
        Connection("here", 2000).town_of("Town99")


def test_carlas_town01_is_planned_in_as_the_file_that_the_server_gives() -> None:
    path = Path(served_town("here", 2000, "town01"))  # the suites' name for it
    assert path.name == "Town01.xodr"
    assert path.is_file()
    assert served_town("here", 2000, str(path)) == str(path)


def test_a_scenario_in_our_own_town01_is_not_driven_in_carlas() -> None:
    with pytest.raises(ValueError, match="found no map 'town01'"):
        Connection("here", 2000).town_of("town01")


class Recorded:
    """A connection that notes what is asked of it."""

    def __init__(self, log: list[str], *_: Any) -> None:
        self.log, self.alive, self.has_manager = log, True, False
        log.append("connected")

    def is_alive(self) -> bool:
        return self.alive

    def synchronise(self) -> None:
        self.log.append("synchronised")

    def town_of(self, town: str) -> str:
        raise ValueError(f"no {town}")

    def close(self) -> None:
        self.log.append("closed")


def test_a_reset_that_fails_puts_everything_back(monkeypatch: pytest.MonkeyPatch) -> None:
    log: list[str] = []
    monkeypatch.setattr(client_world, "Connection", lambda *_: Recorded(log))
    world = CarlaWorld()
    for _ in range(2):
        with pytest.raises(ValueError, match="no town01"):
            world.reset(task_scenarios("town01", "straight")[0])
    world.close()
    assert log == ["connected", "synchronised", "closed"] * 2


def test_a_server_that_was_started_anew_is_connected_to_again(monkeypatch: pytest.MonkeyPatch) -> None:
    log: list[str] = []
    monkeypatch.setattr(client_world, "Connection", lambda *_: Recorded(log))
    world = CarlaWorld()
    old: Any = Recorded([])
    old.alive, world._connection = False, old
    with pytest.raises(ValueError, match="no town01"):
        world.reset(task_scenarios("town01", "straight")[0])
    assert log == ["connected", "synchronised", "closed"]
    assert old.log == ["connected"]


def test_where_a_traffic_manager_drove_for_a_dead_server_the_command_has_to_be_typed_again() -> None:
    world, old = CarlaWorld(), Recorded([])
    old.alive, old.has_manager, world._connection = False, True, old  # type: ignore[assignment]
    with pytest.raises(RuntimeError, match="has gone while CARLA's traffic manager drove cars there"):
        world.reset(task_scenarios("town01", "straight")[0])
