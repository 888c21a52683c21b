"""CARLA's own client, unchanged, against the server: both are processes of their own."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

from caldrive.carla_bridge.server.actors import NOBODY, Actor
from caldrive.carla_bridge.server.server import Server
from caldrive.carla_bridge.server.settings import ServerSettings
from caldrive.carla_bridge.server.streams import Subscriber
from caldrive.commands.serve_carla import make_server
from tests.carla_bridge.server.wire_client import WireClient, free_port

PORT, MANAGER = free_port(), free_port()
ROOT = Path(__file__).parents[3]
PATIENCE = 900.0  # s
LAST_CALL = 20  # of those that `perishes` makes
pytestmark = pytest.mark.skipif(find_spec("carla") is None, reason="needs the wheel of CARLA's client")


HOME = TemporaryDirectory()  # the client keeps files there


def environment() -> dict[str, str]:
    path = os.pathsep.join((str(ROOT / "src"), str(ROOT), os.environ.get("PYTHONPATH", "")))
    return {**os.environ, "HOME": HOME.name, "PYTHONPATH": path}


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[subprocess.Popen[bytes]]:
    """A server that runs until the last test."""
    said = tmp_path_factory.mktemp("server") / "said.txt"
    command = [sys.executable, "-m", "caldrive", "serve-carla", "--port", str(PORT)]
    with said.open("wb") as file, subprocess.Popen(command, env=environment(), stderr=file, stdout=file) as process:
        deadline = time.monotonic() + PATIENCE
        while "may connect" not in said.read_text():
            assert process.poll() is None, said.read_text()
            assert time.monotonic() < deadline
            time.sleep(0.1)
        yield process
        assert process.poll() in (None, -signal.SIGKILL), said.read_text()
        process.kill()
    assert "found a fault" not in said.read_text()


@contextmanager
def start(program: str, *arguments: str, port: int = PORT) -> Iterator[subprocess.Popen[str]]:
    """A program as a process, which ends with the block."""
    command = [sys.executable, "-m", f"tests.carla_bridge.server.programs.{program}", str(port), *arguments]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, env=environment(), cwd=ROOT, stdout=pipe, stderr=pipe, text=True) as process:
        try:
            yield process
        finally:
            process.kill()


def run(program: str, *arguments: str) -> Any:
    """What a program prints as JSON."""
    with start(program, *arguments) as process:
        said, complaints = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, complaints
    *_, last = said.splitlines()
    return json.loads(last) if last.startswith("{") else last


def test_cameras_come_in_step_with_ticks_and_show_what_they_should(server: subprocess.Popen[bytes]) -> None:
    found = run("cameras")
    assert found["frames"] == 12
    assert found["moved"] > 1.0
    assert found["speed"] > 2.0
    assert found["spread"] > 20  # a picture of something
    assert {1, 11} <= set(found["labels"])  # road and sky
    assert 2.0 < found["below"] < 8.0  # m to the road in the lowest row
    assert found["sky"] > 900.0
    assert found["fov"] == 90.0
    assert found["latitude_error"] < 1e-7
    assert found["longitude_error"] < 1e-7


def test_the_same_program_gets_the_same_images(server: subprocess.Popen[bytes]) -> None:
    assert run("cameras") == run("cameras")


def test_every_kind_of_call_works_through_the_client(server: subprocess.Popen[bytes]) -> None:
    run("everything")


def test_the_clients_traffic_manager_and_crowd_drive_and_walk(server: subprocess.Popen[bytes]) -> None:
    found = run("traffic", str(MANAGER))
    assert min(found["cars"]) > 3.0
    assert max(found["walkers"]) > 2.0


def test_a_route_planner_and_an_agent_find_their_way_on_the_map(server: subprocess.Popen[bytes]) -> None:
    found = run("planner")
    assert found["edges"] > 100
    assert found["broken"] == 0
    assert found["reached"] == 1.0  # from every lane to every other
    assert found["lights"] == 36
    assert found["driven"] > 100.0
    assert found["off"] < 0.8
    assert found["red"] > 0
    assert found["bumps"] == 0


def test_a_client_that_is_killed_at_any_moment_costs_nobody_else_anything(server: subprocess.Popen[bytes]) -> None:
    for k in range(5):
        with start("cameras") as process:
            assert process.stdout is not None
            assert process.stdout.readline() == "connected\n"
            time.sleep(0.03 * k)
            process.kill()
    assert run("cameras")["moved"] > 1.0


def test_a_program_in_asynchronous_mode_goes_with_the_clock(server: subprocess.Popen[bytes]) -> None:
    found = run("asynchronous")
    assert found["in_order"]
    assert found["step"] == pytest.approx(0.05)  # s
    assert found["speed"] > 2.0
    assert found["image"] == [64, 32]
    assert (found["heard"], found["ticks"], found["left"]) == (True, True, 0)


@pytest.fixture
def near() -> Iterator[Server]:
    """A server in this process, which turns while a program runs."""
    made = make_server(ServerSettings(town="town01", port=free_port()))
    yield made
    made.close()


def beside(near: Server, program: str, *arguments: str) -> subprocess.Popen[str]:
    """A program that has run to its end beside a server."""
    with start(program, *arguments, port=near.settings.port) as process:
        while process.poll() is None:
            near.turn(0.05)
        return process


def test_a_client_whose_sensors_have_ended_does_not_connect_again_and_again(
    near: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    connections: list[int] = []
    counted = Subscriber.__init__

    def counting(one: Subscriber, connection: socket.socket) -> None:
        connections.append(1)
        counted(one, connection)

    monkeypatch.setattr(Subscriber, "__init__", counting)
    assert beside(near, "orphans").returncode == 0
    assert len(connections) == 4  # of the world and three sensors


def test_a_client_that_is_killed_at_any_call_leaves_nothing(near: Server, capfd: pytest.CaptureFixture[str]) -> None:
    for k in range(1, LAST_CALL + 1):
        assert beside(near, "perishes", str(k)).returncode == -signal.SIGKILL
        newcomer = WireClient(near)
        assert newcomer.call("version") == "0.9.16"
        assert not [one.kind for one in near.episode.all(Actor) if one.owner != NOBODY]
        assert newcomer.call("get_episode_settings")[0] is False
        newcomer.leave()
    assert "fault" not in capfd.readouterr().err


def test_a_client_whose_server_is_killed_is_told_so(server: subprocess.Popen[bytes]) -> None:  # the last test
    with start("bereft") as process:
        assert process.stdout is not None
        assert [process.stdout.readline() for _ in range(2)] == ["connected\n", "ticking\n"]
        server.kill()
        said, complaints = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, complaints
    assert "time-out" in json.loads(said)["said"]
