"""The connection to a CARLA server, with a stand-in for CARLA's client."""

from __future__ import annotations

from contextlib import nullcontext
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


class Clock:
    """A world in synchronous mode, left so by somebody or stepped by another client."""

    def __init__(self, step: int) -> None:
        self.frame, self._step, self.settings = (
            7,
            step,
            SimpleNamespace(synchronous_mode=True, fixed_delta_seconds=0.05),
        )

    def get_settings(self) -> SimpleNamespace:
        return SimpleNamespace(**vars(self.settings))

    def apply_settings(self, settings: SimpleNamespace) -> None:
        self.settings = settings

    def get_snapshot(self) -> Any:
        self.frame += self._step
        return SimpleNamespace(frame=self.frame, timestamp=SimpleNamespace(elapsed_seconds=5.0))

    def get_actors(self) -> list[Any]:
        return []

    def tick(self, _: float) -> int:
        return self.frame


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> Clock:
    monkeypatch.setattr(connection, "STILL", 0.0)
    made = Clock(request.param)
    monkeypatch.setattr(Client, "get_world", lambda _: made)
    return made


@pytest.mark.parametrize("clock", [0], indirect=True)
def test_a_server_that_a_killed_process_left_waiting_goes_on_in_the_end(clock: Clock) -> None:
    found = Connection("here", 2000)
    found.synchronise()
    assert (clock.settings.synchronous_mode, clock.settings.fixed_delta_seconds) == (True, 0.1)
    found.close()
    assert (clock.settings.synchronous_mode, clock.settings.fixed_delta_seconds) == (False, None)


@pytest.mark.parametrize("clock", [1], indirect=True)
def test_a_server_that_another_client_steps_is_refused_and_left_as_it_is(clock: Clock) -> None:
    found = Connection("here", 2000)
    with pytest.raises(RuntimeError, match=r"^found another client that steps CARLA at here:2000, wanted it alone"):
        found.synchronise()
    found.close()
    assert (clock.settings.synchronous_mode, clock.settings.fixed_delta_seconds) == (True, 0.05)


def test_a_connection_that_fails_while_it_is_cleared_is_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    class Failing(Recorded):
        def answers(self) -> Any:
            return nullcontext()

        def clear(self) -> None:
            raise RuntimeError(SAID)

    log: list[str] = []
    world = CarlaWorld()
    world._connection = Failing(log)  # type: ignore[assignment]
    with pytest.raises(RuntimeError, match="time-out"):
        world.reset(task_scenarios("town01", "straight")[0])
    assert log == ["connected", "closed"]


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
