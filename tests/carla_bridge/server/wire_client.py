"""A client of the server's protocol in its own process and thread: whatever it sends, the server turns until it has
answered."""

from __future__ import annotations

import os
import socket
import struct
import time
from contextlib import suppress
from random import Random
from typing import Any

import msgpack

from caldrive.carla_bridge.server.server import Server

PATIENCE = 20.0  # s
PORTS = Random(os.getpid())


class RefusedError(Exception):
    """The server answered with a sentence."""


class WireClient:
    """A connection for calls."""

    def __init__(self, server: Server) -> None:
        self.server = server
        self.socket = socket.create_connection(("127.0.0.1", server.clients.port))
        self.socket.setblocking(False)
        self._unpacker, self._next = msgpack.Unpacker(raw=False), 0
        self.readers: list[socket.socket] = []

    def call(self, method: str, *arguments: Any) -> Any:
        """The unwrapped result of a call. Raises RefusedError with the sentence of a refusal."""
        self._next += 1
        self.socket.send(msgpack.packb([0, self._next, method, [[False], *arguments]]))
        kind, id, error, result = self._answer()
        assert (kind, id, error) == (1, self._next, None)
        if method == "apply_batch":
            return result
        match result:
            case [[False]]:
                return None
            case [[True, [text]]] | [[0, [text]]]:  # 1 is matched by True, but not True by 1
                raise RefusedError(text)
            case [[1, value]]:
                return value
        raise AssertionError(f"{method} gave {result!r}")

    def tell(self, method: str, *arguments: Any) -> Any:
        """The whole result of a call whose answer CARLA's client would not read."""
        self._next += 1
        self.socket.send(msgpack.packb([0, self._next, method, [[True], *arguments]]))
        return self._answer()[3]

    def _answer(self) -> Any:
        deadline = time.monotonic() + PATIENCE
        while time.monotonic() < deadline:
            self.server.turn(0.01)
            try:
                received = self.socket.recv(2**20)
            except BlockingIOError:
                continue
            if not received:
                raise ConnectionError
            self._unpacker.feed(received)
            for message in self._unpacker:
                return message
        raise TimeoutError

    def synchronous(self, delta: float = 0.1) -> None:
        """The client ticks from now on."""
        self.call("set_episode_settings", [True, False, [True, delta], True, 0.01, 10, 0.0, True, 3000.0, 2000.0, True])

    def spawn(self, id: str, at: tuple[float, ...], **attributes: str) -> int:
        """The number of a new actor at x, y, yaw."""
        x, y, yaw = at
        rows = [[name, 4, value] for name, value in attributes.items()]
        actor = self.call("spawn_actor", [1, id, rows], [[x, y, 0.3], [0.0, yaw, 0.0]])
        number: int = actor[0]
        return number

    def leave(self) -> None:
        """Goes without a word."""
        for one in (self.socket, *self.readers):
            one.close()
        self.server.turn(0.1)


class Reader:
    """A connection to a stream."""

    def __init__(self, client: WireClient, stream: int) -> None:
        token = client.call("get_sensor_token", stream)[0]
        number, port = struct.unpack_from("<IH", token)
        assert number == stream
        self.server, self._bytes = client.server, b""
        self.socket = socket.create_connection(("127.0.0.1", port))
        client.readers.append(self.socket)
        self.socket.send(struct.pack("<I", stream))
        self.socket.setblocking(False)

    def message(self) -> bytes:
        """The next message."""
        deadline = time.monotonic() + PATIENCE
        while time.monotonic() < deadline:
            if len(self._bytes) >= 4:
                (size,) = struct.unpack_from("<I", self._bytes)
                if len(self._bytes) >= 4 + size:
                    message, self._bytes = self._bytes[4 : 4 + size], self._bytes[4 + size :]
                    return message
            try:
                self._bytes += self.socket.recv(2**20)
            except BlockingIOError:
                self.server.turn(0.01)
        raise TimeoutError


def positions(snapshot: bytes) -> dict[int, tuple[float, float]]:
    """Where each actor of a snapshot is: x, y in CARLA's axes."""
    rows = snapshot[48 + 36 :]
    assert len(rows) % 119 == 0
    found = (struct.unpack_from("<IB2f", rows, k) for k in range(0, len(rows), 119))
    return {id: (x, y) for id, _, x, y in found}


def free_port() -> int:
    """The first of three ports in a row that nobody has: each process of a test run serves by its own. They are not
    among those that a system gives to whoever connects."""
    while True:
        port = PORTS.randrange(10_000, 30_000)
        with suppress(OSError):
            for k in range(3):
                socket.create_server(("127.0.0.1", port + k)).close()
            return port
