"""Well-formed calls with odd values in them: each is served or refused in a sentence, and the server lives."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import numpy as np
import pytest

from caldrive.carla_bridge.server.server import Server
from caldrive.carla_bridge.server.settings import ServerSettings
from caldrive.commands.serve_carla import make_server
from tests.carla_bridge.server.test_all_calls import REFUSED, SERVED, T, V
from tests.carla_bridge.server.wire_client import Reader, RefusedError, WireClient, free_port

ODD = [
    math.nan,
    math.inf,
    -1e300,
    1e38,
    -1,
    0,
    2**31,
    2**63,
    -(2**63),
    "",
    "x" * 1000,
    None,
    True,
    [],
    {},
    b"\xff",
    [[]],
]
CONTROL = [0.5, 0.1, 0.0, False, False, False, 0]
WHEEL = [3.5, 0.25, 35.0, 33.0, 1500.0, 3000.0, 2.0, 17.0, 1000.0, [0.0, 0.0, 0.0]]
PHYSICS = [[[0.0, 400.0]], 5000.0, 1.0, 0.15, 2.0, 0.35, True, 0.5, 10.0, 4.0, [[1.0, 0.5, 0.6]], 1400.0, 0.3,
           [0.0, 0.0, 0.0], [[0.0, 1.0]], [WHEEL] * 4, False]  # fmt: skip
ASKED = [1, "sensor.other.imu", [["sensor_tick", 3, "0.1"]]]
CALLS: dict[str, list[Any]] = {
    **SERVED, **REFUSED, "apply_physics_control": ["car", PHYSICS], "spawn_actor": [ASKED, T],
    "spawn_actor_with_parent": [ASKED, T, "car", 0, ""], "load_new_episode": ["town01", False, 0],
    "set_episode_settings": [[True, False, [True, 0.1], True, 0.01, 10, 0.0, True, 3000.0, 2000.0, True]],
}  # fmt: skip
COMMANDS: dict[int, list[Any]] = {
    0: [ASKED, T, [True, "car"], 0, "", [[[2, [0, CONTROL]]]]], 1: [10**6], 2: ["car", CONTROL],
    3: ["car", [0.1, 0.0, 3.0, 0.0, 0.0]], 4: ["walker", [V, 1.0, False]], 5: ["car", PHYSICS], 6: ["car", T],
    7: ["walker", T, 1.0], 8: ["car", V], 9: ["car", V], 10: ["car", V], 11: ["car", V], 12: ["car", V],
    13: ["car", V], 14: ["car", True], 15: ["car", True], 16: ["car", True], 17: ["car", True], 18: ["car", 3],
    19: ["car", V], 20: ["x"], 21: ["light", 2],
}  # fmt: skip


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    made = make_server(ServerSettings(town="town01", port=free_port()))
    yield made
    made.close()


@pytest.fixture
def client(server: Server) -> Iterator[WireClient]:
    made = WireClient(server)
    made.synchronous()
    yield made
    made.leave()


def odd(arguments: list[Any]) -> Iterator[list[Any]]:
    """The same with one value after the other, at every depth, replaced by each of the odd ones, or left out."""
    for k, value in enumerate(arguments):
        for strange in ODD:
            yield [*arguments[:k], strange, *arguments[k + 1 :]]
        yield arguments[:k] + arguments[k + 1 :]
        if isinstance(value, list):
            yield from ([*arguments[:k], part, *arguments[k + 1 :]] for part in odd(value))


class Cast:
    """A car with sensors, a walker and a light; whoever is destroyed meanwhile is replaced."""

    def __init__(self, client: WireClient) -> None:
        self._client = client
        self._numbers: dict[str, int] = {}

    def _spawn(self, kind: str, x: float) -> int:
        return self._client.spawn(kind, (x, -400.0, 0.0))

    def numbers(self) -> dict[str, int]:
        known, server = self._numbers, self._client.server
        if known.get("light") != server.episode.lights.actors[0].id:
            known.clear()
        if server.episode.get(known.get("car", -1)) is None:
            known["car"] = self._spawn("vehicle.tesla.model3", -400.0)
            for sensor in ("imu", "gnss", "collision"):
                about = [1, f"sensor.other.{sensor}", []]
                number, *_ = self._client.call("spawn_actor_with_parent", about, T, known["car"], 0, "")
                Reader(self._client, number + 1)
        if server.episode.get(known.get("walker", -1)) is None:
            known["walker"] = self._spawn("walker.pedestrian.0001", -420.0)
        known["light"] = server.episode.lights.actors[0].id
        return known


def played(arguments: Any, who: dict[str, int]) -> Any:
    """Arguments with numbers in the place of names."""
    if isinstance(arguments, list):
        return [played(one, who) for one in arguments]
    return who.get(arguments, arguments) if isinstance(arguments, str) else arguments


def goes_on(client: WireClient) -> None:
    """A step is made, and everybody is somewhere."""
    client.call("tick_cue")
    rows = np.frombuffer(client.server._latest[48 + 36 :], np.uint8).reshape(-1, 119)
    assert np.isfinite(rows[:, 5:65].copy().view("<f4")).all()


@pytest.mark.parametrize("method", CALLS)
def test_a_call_with_odd_values_harms_nobody(
    client: WireClient, method: str, capfd: pytest.CaptureFixture[str]
) -> None:
    cast = Cast(client)
    for arguments in odd(copy.deepcopy(CALLS[method])):
        with suppress(RefusedError):
            client.call(method, *played(arguments, cast.numbers()))
        client.synchronous()
        goes_on(client)
    assert "fault" not in capfd.readouterr().err


@pytest.mark.parametrize("index", COMMANDS)
def test_a_command_with_odd_values_harms_nobody(
    client: WireClient, index: int, capfd: pytest.CaptureFixture[str]
) -> None:
    cast = Cast(client)
    for payload in odd(copy.deepcopy(COMMANDS[index])):
        client.call("apply_batch", [[[index, played(payload, cast.numbers())]]], False)
        goes_on(client)
    assert "fault" not in capfd.readouterr().err
