"""Connections that make calls, without a world behind them."""

from __future__ import annotations

import socket
from collections.abc import Iterator

import msgpack
import pytest

from caldrive.carla_bridge.server import clients as module
from caldrive.carla_bridge.server.clients import Clients
from caldrive.carla_bridge.server.log import Log
from caldrive.carla_bridge.server.outbox import listening
from caldrive.carla_bridge.server.wire import Request, served

CALL = msgpack.packb([0, 1, "version", [[False]]])


class World:
    """What stands behind the connections: it notes what it hears."""

    def __init__(self) -> None:
        self.calls, self.gone = 0, list[int]()
        self.clients = Clients(listening("127.0.0.1", 0), Log(), self.serve, self.gone.append)

    def serve(self, caller: int, request: Request) -> object:
        self.calls += 1
        return served("0.9.16", False)

    def connect(self) -> socket.socket:
        made = socket.create_connection(("127.0.0.1", self.clients.port))
        self.turn()
        return made

    def turn(self) -> None:
        for _ in range(3):
            self.clients.poll()
            self.clients.serve_some(0.05)


@pytest.fixture
def world() -> Iterator[World]:
    made = World()
    yield made
    made.clients.close()


def is_closed(one: socket.socket) -> bool:
    one.setblocking(False)
    try:
        return not one.recv(100)
    except BlockingIOError:
        return False


def test_who_has_not_called_is_no_client_and_is_not_missed(world: World) -> None:
    with world.connect():
        assert len(world.clients) == 0
    world.turn()
    assert world.gone == []
    with world.connect() as caller:
        caller.send(CALL)
        world.turn()
        assert len(world.clients) == 1
    world.turn()
    assert world.gone == [2]


def test_who_says_nothing_makes_room_for_others_and_who_calls_stays(
    world: World, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(module, "MOST_CLIENTS", 2)
    caller, silent = world.connect(), world.connect()
    caller.send(CALL)
    world.turn()
    late = world.connect()
    late.send(CALL)
    world.turn()
    assert world.calls == 2
    assert is_closed(silent)
    turned_away = [world.connect() for _ in range(3)]
    assert all(is_closed(one) for one in turned_away)
    assert capsys.readouterr().err.count("turned away") == 1
    for one in (caller, silent, late, *turned_away):
        one.close()


def test_a_machine_that_has_vanished_is_noticed_within_a_minute(world: World) -> None:
    with world.connect():
        [client] = world.clients._clients.values()
        assert client.socket.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE)
        names = (socket.TCP_KEEPIDLE, socket.TCP_KEEPINTVL, socket.TCP_KEEPCNT)
        first, between, n = (client.socket.getsockopt(socket.IPPROTO_TCP, name) for name in names)
        assert first + n * between <= 60  # s


def test_many_who_send_no_calls_are_told_of_once(world: World, capsys: pytest.CaptureFixture[str]) -> None:
    for _ in range(5):
        with world.connect() as one:
            one.send(b"GET / HTTP/1.1\r\n\r\n")
            world.turn()
    assert capsys.readouterr().err.count("was cut off") == 1


def test_what_a_client_asks_for_waits_in_its_socket_before_it_piles_up(
    world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "RECEIVED", 10 * len(CALL))
    monkeypatch.setattr(module, "MOST_ASKED", 20)
    with world.connect() as hasty:
        hasty.send(200 * CALL)
        for _ in range(50):
            world.clients.poll()
        [client] = world.clients._clients.values()
        assert len(client.asked) == 20
        for _ in range(20):
            world.turn()
        assert world.calls == 200
