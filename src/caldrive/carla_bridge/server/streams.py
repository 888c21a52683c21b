"""Streams: what clients subscribe to, each over a connection of its own.

A client asks for a stream's token by a call, connects to the port in it, and writes the stream's number; then messages
come, each behind its size. Who reads too slowly misses messages; who does not read at all is cut off.
"""

from __future__ import annotations

import selectors
import socket
import struct
import time
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

from caldrive.carla_bridge.server.outbox import Gone, Log, Outbox, accepted

WORLD = 1  # the stream of snapshots
TOKEN = struct.Struct("<IHBB16x")
TCP, SAME_HOST = 1, 0  # the protocol in a token; the address that a client has already
MOST_WAITING = 32_000_000  # bytes that a subscriber may be behind
PATIENCE = 1.0  # s that a subscriber may take for nothing, and that an announced one may take to come
MOST_SUBSCRIBERS = 512


class Subscriber:
    """One connection. stream: what it reads, 0 until it has said so."""

    def __init__(self, connection: socket.socket) -> None:
        self.socket, self.outbox = connection, Outbox(connection)
        self.stream, self._said = 0, b""

    def hear(self) -> bool:
        """Whether it has said now which stream it wants. Raises Gone, as for anything that it says later."""
        try:
            said = self.socket.recv(4 - len(self._said) or 64)
        except (BlockingIOError, InterruptedError):
            return False
        except OSError as error:
            raise Gone from error
        if not said or self.stream:
            if said:
                return False
            raise Gone
        self._said += said
        if len(self._said) < 4:
            return False
        (self.stream,) = struct.unpack("<I", self._said)
        return True


class Streams:
    """All streams of a server. newcomer: what somebody who subscribes to a stream gets at once, if anything."""

    def __init__(self, waiting: socket.socket, log: Log, newcomer: Callable[[int], Sequence[Any] | None]) -> None:
        self._waiting, self._log, self._newcomer = waiting, log, newcomer
        self.port = int(waiting.getsockname()[1])
        self._selector = selectors.DefaultSelector()
        self._selector.register(waiting, selectors.EVENT_READ)
        self._subscribers: set[Subscriber] = set()
        self._by_stream: dict[int, list[Subscriber]] = {}
        self._announced: Counter[int] = Counter()
        self._skipped: set[Subscriber] = set()

    def fileno(self) -> int:
        """For whoever waits until something happens here."""
        return self._selector.fileno()

    def token(self, stream: int) -> bytes:
        """What a client needs to subscribe."""
        return TOKEN.pack(stream, self.port, TCP, SAME_HOST)

    def announce(self, stream: int) -> None:
        """Somebody has asked for a token, and will subscribe."""
        self._announced[stream] += 1

    def is_wanted(self, stream: int) -> bool:
        """Whether anybody subscribes."""
        return bool(self._by_stream.get(stream))

    def send(self, stream: int, pieces: Sequence[Any]) -> None:
        """Sends a message to all who subscribe and keep up."""
        for subscriber in tuple(self._by_stream.get(stream, ())):
            if subscriber.outbox.waiting > MOST_WAITING:
                if subscriber not in self._skipped:
                    self._log(f"somebody reads stream {stream} too slowly and misses messages")
                self._skipped.add(subscriber)
                continue
            self._put(subscriber, pieces)

    def close_stream(self, stream: int) -> None:
        """Ends a stream."""
        for subscriber in self._by_stream.pop(stream, []):
            self._drop(subscriber)

    def settle(self) -> None:
        """Waits a moment for subscribers who are announced, and for those who have not read what was sent."""
        deadline = time.monotonic() + PATIENCE
        while self._announced.total() and (left := deadline - time.monotonic()) > 0:
            self.poll(left)
        self._announced.clear()
        deadline, behind = time.monotonic() + PATIENCE, self._behind()
        while behind and (left := deadline - time.monotonic()) > 0:
            self.poll(left)
            now = self._behind()
            if now != behind:  # somebody reads
                deadline = time.monotonic() + PATIENCE
            behind = now
        for subscriber in behind:
            self._log(f"somebody who does not read stream {subscriber.stream} was cut off")
            self._drop(subscriber)

    def _behind(self) -> dict[Subscriber, int]:
        """Who is so far behind that the next message might not reach them, and by how many bytes."""
        return {one: one.outbox.waiting for one in self._subscribers if one.outbox.waiting > MOST_WAITING // 2}

    def poll(self, patience: float = 0.0) -> None:
        """Lets in who comes, hears what they want, and sends on what waits."""
        for key, events in self._selector.select(patience):
            if key.data is None:
                self._let_in()
                continue
            try:
                if events & selectors.EVENT_WRITE:
                    key.data.outbox.flush()
                    self._watch(key.data)
                if events & selectors.EVENT_READ and key.data.hear():
                    self._subscribe(key.data)
            except Gone:
                self._drop(key.data)

    def _let_in(self) -> None:
        while (connection := accepted(self._waiting)) is not None:
            if len(self._subscribers) >= MOST_SUBSCRIBERS:
                connection.close()
                continue
            subscriber = Subscriber(connection)
            self._subscribers.add(subscriber)
            self._selector.register(connection, selectors.EVENT_READ, subscriber)

    def _subscribe(self, subscriber: Subscriber) -> None:
        stream = subscriber.stream
        self._by_stream.setdefault(stream, []).append(subscriber)
        self._announced[stream] -= 1
        if self._announced[stream] <= 0:
            del self._announced[stream]
        first = self._newcomer(stream)
        if first is not None:
            self._put(subscriber, first)

    def _put(self, subscriber: Subscriber, pieces: Sequence[Any]) -> None:
        size = sum(memoryview(piece).nbytes for piece in pieces)
        try:
            subscriber.outbox.put([struct.pack("<I", size), *pieces])
            self._watch(subscriber)
        except Gone:
            self._drop(subscriber)

    def _watch(self, subscriber: Subscriber) -> None:
        """Waits for room in a socket as long as something has to be sent."""
        writes = selectors.EVENT_WRITE if subscriber.outbox.waiting else 0
        key = self._selector.get_key(subscriber.socket)
        if key.events != selectors.EVENT_READ | writes:
            self._selector.modify(subscriber.socket, selectors.EVENT_READ | writes, subscriber)

    def _drop(self, subscriber: Subscriber) -> None:
        if subscriber not in self._subscribers:
            return
        self._subscribers.discard(subscriber)
        self._skipped.discard(subscriber)
        if subscriber in self._by_stream.get(subscriber.stream, ()):
            self._by_stream[subscriber.stream].remove(subscriber)
        self._selector.unregister(subscriber.socket)
        subscriber.socket.close()

    def close(self) -> None:
        """Ends all of them."""
        for subscriber in tuple(self._subscribers):
            self._drop(subscriber)
        self._selector.close()
        self._waiting.close()
