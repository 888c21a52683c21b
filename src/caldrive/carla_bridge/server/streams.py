"""Streams: what clients subscribe to, each over a connection of its own.

A client asks for a stream's token by a call, connects to the port in it, and writes the stream's number; then messages
come, each behind its size. Who reads too slowly misses messages; who does not read at all is cut off.

CARLA's client comes again at once, and for ever, where a connection is closed. So those to a stream that has ended stay
open, and nothing comes on them.
"""

from __future__ import annotations

import selectors
import socket
import struct
import time
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

from caldrive.carla_bridge.server.log import Log
from caldrive.carla_bridge.server.outbox import Gone, Outbox, accepted

WORLD = 1  # the stream of snapshots
TOKEN = struct.Struct("<IHBB16x")
TCP, SAME_HOST = 1, 0  # the protocol in a token; the address that a client has already
MOST_WAITING = 16_000_000  # bytes that a subscriber may be behind; the largest image may be more
PATIENCE = 1.0  # s that the world waits for subscribers who are announced, and for those who are behind
STALLED = 10.0  # s without reading anything after which a slow subscriber is cut off
MOST_SUBSCRIBERS = 512
MOST_PARKED = 256  # connections to streams that have ended
SILENCE = 10.0  # s in which whoever connects has to say which stream they want


class Subscriber:
    """One connection. stream: what it reads, None until it has said so."""

    def __init__(self, connection: socket.socket) -> None:
        self.socket, self.outbox = connection, Outbox(connection)
        self.stream: int | None = None
        self.came, self._said = time.monotonic(), b""

    def hear(self) -> bool:
        """Whether it has said now which stream it wants. Raises Gone, as for anything that it says later."""
        try:
            said = self.socket.recv(4 - len(self._said) or 64)
        except (BlockingIOError, InterruptedError):
            return False
        except OSError as error:
            raise Gone from error
        if not said:
            raise Gone
        if self.stream is not None:
            return False
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
        self._subscribers: dict[Subscriber, None] = {}  # in the order in which they came
        self._parked: dict[Subscriber, None] = {}  # those of them whose stream has ended
        self._by_stream: dict[int, list[Subscriber]] = {}
        self._announced: Counter[int] = Counter()
        self._open: set[int] = set()  # those that somebody has a token of
        self._slow: dict[Subscriber, tuple[int, float]] = {}  # bytes that they are behind, and since when (s)

    def fileno(self) -> int:
        """For whoever waits until something happens here."""
        return self._selector.fileno()

    def token(self, stream: int) -> bytes:
        """What a client needs to subscribe."""
        self._open.add(stream)
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
            if self._keeps_up(subscriber):
                self._put(subscriber, pieces)

    def _keeps_up(self, subscriber: Subscriber) -> bool:
        """Whether a subscriber is to get the next message. Who once was too slow has to read all that waits first."""
        now, waiting = time.monotonic(), subscriber.outbox.waiting
        if subscriber not in self._slow:
            if waiting <= MOST_WAITING:
                return True
            self._log(f"somebody reads stream {subscriber.stream} too slowly and misses messages")
            self._slow[subscriber] = waiting, now
        elif waiting == 0:
            del self._slow[subscriber]
            return True
        elif waiting < self._slow[subscriber][0]:
            self._slow[subscriber] = waiting, now
        elif now - self._slow[subscriber][1] > STALLED:
            self._log(f"somebody who does not read stream {subscriber.stream} was cut off")
            self._drop(subscriber)
        return False

    def close_stream(self, stream: int) -> None:
        """Ends a stream."""
        self._open.discard(stream)
        self._announced.pop(stream, None)  # nobody will come for it any more
        for subscriber in self._by_stream.pop(stream, []):
            self._park(subscriber)

    def settle(self) -> None:
        """Waits a moment for subscribers who are announced, and for those who are behind; not for slow ones."""
        deadline = time.monotonic() + PATIENCE
        while (self._announced.total() or self._is_anybody_behind()) and (left := deadline - time.monotonic()) > 0:
            self.poll(left)
        self._announced.clear()

    def _is_anybody_behind(self) -> bool:
        """So far that they would miss the next message."""
        return any(one.outbox.waiting > MOST_WAITING and one not in self._slow for one in self._subscribers)

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
                    self._subscribe(key.data, key.data.stream)
            except Gone:
                self._drop(key.data)

    def _let_in(self) -> None:
        while (connection := accepted(self._waiting)) is not None:
            self._drop_silent()
            if len(self._subscribers) - len(self._parked) >= MOST_SUBSCRIBERS:
                self._log.rarely("a subscriber was turned away", f"as there are {MOST_SUBSCRIBERS}")
                connection.close()
                continue
            subscriber = Subscriber(connection)
            self._subscribers[subscriber] = None
            self._selector.register(connection, selectors.EVENT_READ, subscriber)

    def _drop_silent(self) -> None:
        """Makes room: who has not said what they want will not."""
        latest = time.monotonic() - SILENCE
        for subscriber in [one for one in self._subscribers if one.stream is None and one.came < latest]:
            self._drop(subscriber)

    def _subscribe(self, subscriber: Subscriber, stream: int) -> None:
        if stream not in self._open:
            self._park(subscriber)
            return
        self._by_stream.setdefault(stream, []).append(subscriber)
        self._announced[stream] -= 1
        if self._announced[stream] <= 0:
            del self._announced[stream]
        first = self._newcomer(stream)
        if first is not None:
            self._put(subscriber, first)

    def _park(self, subscriber: Subscriber) -> None:
        """Nothing comes any more. Who has not read what came before starts anew."""
        self._slow.pop(subscriber, None)
        if subscriber.outbox.waiting:
            self._drop(subscriber)
            return
        self._parked[subscriber] = None
        if len(self._parked) > MOST_PARKED:
            self._drop(next(iter(self._parked)))

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
        del self._subscribers[subscriber]
        self._parked.pop(subscriber, None)
        self._slow.pop(subscriber, None)
        stream = subscriber.stream
        if stream is not None and subscriber in self._by_stream.get(stream, ()):
            self._by_stream[stream].remove(subscriber)
            if not self._by_stream[stream]:
                del self._by_stream[stream]
        self._selector.unregister(subscriber.socket)
        subscriber.socket.close()

    def close(self) -> None:
        """Ends all of them."""
        for subscriber in tuple(self._subscribers):
            self._drop(subscriber)
        self._selector.close()
        self._waiting.close()
