"""The connections that make calls: what comes is answered in its order, one connection after the other.

A connection is a client from its first call on: who only connects, as what looks for open ports does, changes nothing.
"""

from __future__ import annotations

import selectors
import socket
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from caldrive.carla_bridge.server.log import Log
from caldrive.carla_bridge.server.outbox import Gone, Outbox, accepted
from caldrive.carla_bridge.server.wire import BrokenMessage, Request, Requests, answer

RECEIVED = 2**18  # bytes that are read at once
MOST_CLIENTS = 128
MOST_ASKED = 1000  # calls that a client may be ahead of its answers; the next wait in its socket
MOST_UNREAD = 64_000_000  # bytes of answers that a client may leave unread


@dataclass(eq=False)
class Client:
    """One of them."""

    number: int
    socket: socket.socket
    outbox: Outbox
    requests: Requests = field(default_factory=Requests)
    asked: deque[Request] = field(default_factory=deque)
    """What it waits for an answer to."""
    has_called: bool = False


class Clients:
    """All of them, by number. serve: gives the result of a call; gone: hears who has gone."""

    def __init__(
        self, waiting: socket.socket, log: Log, serve: Callable[[int, Request], Any], gone: Callable[[int], None]
    ) -> None:
        self._waiting, self._log, self._serve, self._gone = waiting, log, serve, gone
        self.port = int(waiting.getsockname()[1])
        self._clients: dict[int, Client] = {}
        self._next = 1
        self._selector = selectors.DefaultSelector()
        self._selector.register(waiting, selectors.EVENT_READ)

    def __len__(self) -> int:
        """How many have called."""
        return sum(client.has_called for client in self._clients.values())

    def fileno(self) -> int:
        """For whoever waits until something happens here."""
        return self._selector.fileno()

    def poll(self) -> None:
        """Lets in who comes, hears what they ask, and sends on what waits."""
        for key, events in self._selector.select(0):
            if key.data is None:
                self._let_in()
            else:
                self._attend(key.data, events)

    def _let_in(self) -> None:
        while (connection := accepted(self._waiting)) is not None:
            if len(self._clients) >= MOST_CLIENTS:
                silent = next((one for one in self._clients.values() if not one.has_called), None)
                if silent is None:
                    self._log.rarely("a client was turned away", f"as there are {MOST_CLIENTS}")
                    connection.close()
                    continue
                self._let_go(silent)
            client = Client(self._next, connection, Outbox(connection))
            self._next += 1
            self._clients[client.number] = client
            self._selector.register(connection, selectors.EVENT_READ, client)

    def _attend(self, client: Client, events: int) -> None:
        """Reads what a client asks for, and sends what it has to get."""
        with self._while_it_lasts(client):
            if events & selectors.EVENT_WRITE:
                client.outbox.flush()
            if events & selectors.EVENT_READ and len(client.asked) < MOST_ASKED:
                self._hear(client)
            self._watch(client)

    def _hear(self, client: Client) -> None:
        try:
            received = client.socket.recv(RECEIVED)
        except (BlockingIOError, InterruptedError):
            return
        except OSError as error:
            raise Gone from error
        if not received:
            raise Gone
        for request in client.requests.feed(received):
            client.asked.append(request)
            client.has_called = True

    @property
    def is_busy(self) -> bool:
        """Whether anybody waits for an answer."""
        return any(client.asked for client in self._clients.values())

    def serve_some(self, seconds: float) -> None:
        """Answers what is asked, one call of each client in turn, for so long at most."""
        until = time.monotonic() + seconds
        while self.is_busy and time.monotonic() < until:
            for client in [one for one in self._clients.values() if one.asked]:
                self._answer(client)

    def _answer(self, client: Client) -> None:
        """Answers a client's next call."""
        request = client.asked.popleft()
        with self._while_it_lasts(client):
            client.outbox.put([answer(request.id, self._serve(client.number, request))])
            if client.outbox.waiting > MOST_UNREAD:
                raise BrokenMessage("it does not read its answers")
            self._watch(client)

    def _watch(self, client: Client) -> None:
        """Waits for room in a socket as long as something has to be sent."""
        writes = selectors.EVENT_WRITE if client.outbox.waiting else 0
        if self._selector.get_key(client.socket).events != selectors.EVENT_READ | writes:
            self._selector.modify(client.socket, selectors.EVENT_READ | writes, client)

    @contextmanager
    def _while_it_lasts(self, client: Client) -> Iterator[None]:
        """Lets a client go that has gone, or sends what is no message."""
        try:
            yield
        except Gone:
            self._let_go(client)
        except BrokenMessage as error:
            self._log.rarely("a client was cut off", f"{error}; wanted calls of CARLA 0.9.16: use its client")
            self._let_go(client)

    def _let_go(self, client: Client) -> None:
        self._selector.unregister(client.socket)
        client.socket.close()
        del self._clients[client.number]
        if client.has_called:
            self._gone(client.number)

    def close(self) -> None:
        """Ends all of them."""
        for client in self._clients.values():
            client.socket.close()
        self._selector.close()
        self._waiting.close()
