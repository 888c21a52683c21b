"""Streams and those who read them too slowly, or not at all."""

from __future__ import annotations

import socket
import struct
import time
from collections.abc import Iterator
from contextlib import suppress

import pytest

from caldrive.carla_bridge.server import streams as module
from caldrive.carla_bridge.server.log import Log
from caldrive.carla_bridge.server.outbox import listening
from caldrive.carla_bridge.server.streams import Streams

STREAM = 5
MEGABYTE = bytes(1_000_000)


class Said(Log, list[str]):
    """A log that is kept."""

    def __call__(self, sentence: str) -> None:
        self.append(sentence)


@pytest.fixture
def said() -> Said:
    return Said()


@pytest.fixture
def streams(said: Said, monkeypatch: pytest.MonkeyPatch) -> Iterator[Streams]:
    monkeypatch.setattr(module, "MOST_WAITING", 20_000_000)
    monkeypatch.setattr(module, "PATIENCE", 0.2)
    monkeypatch.setattr(module, "STALLED", 0.2)
    made = Streams(listening("127.0.0.1", 0), said, newcomer=lambda stream: [b"first"])
    yield made
    made.close()


@pytest.fixture
def reader(streams: Streams) -> Iterator[socket.socket]:
    with socket.create_connection(("127.0.0.1", streams.port)) as made:
        streams.announce(STREAM)
        streams.token(STREAM)
        made.send(struct.pack("<I", STREAM))
        streams.settle()
        yield made


def test_a_subscriber_hears_the_latest_at_once(reader: socket.socket) -> None:
    assert reader.recv(100) == struct.pack("<I", 5) + b"first"


def test_a_token_says_where_a_stream_is(streams: Streams) -> None:
    assert struct.unpack("<IHBB16x", streams.token(STREAM)) == (STREAM, streams.port, 1, 0)


def test_whoever_is_announced_and_does_not_come_is_waited_for_only_a_moment(streams: Streams) -> None:
    streams.announce(STREAM)
    begin = time.monotonic()
    streams.settle()
    streams.settle()
    assert 0.15 < time.monotonic() - begin < 5.0
    assert not streams.is_wanted(STREAM)


def test_nobody_waits_for_those_who_were_announced_to_a_stream_that_has_ended(streams: Streams) -> None:
    streams.announce(STREAM)
    streams.close_stream(STREAM)
    begin = time.monotonic()
    streams.settle()
    assert time.monotonic() - begin < 0.1


def test_who_does_not_read_misses_messages_and_is_cut_off(streams: Streams, reader: socket.socket, said: Said) -> None:
    for _ in range(40):
        streams.send(STREAM, [MEGABYTE])  # does not wait
    assert len(said) == 1
    assert "misses messages" in said[0]
    begin = time.monotonic()
    streams.settle()
    assert time.monotonic() - begin < 0.1  # nobody waits for it any more
    time.sleep(0.3)
    streams.send(STREAM, [MEGABYTE])
    assert not streams.is_wanted(STREAM)
    assert "cut off" in said[-1]


def test_whoever_reads_all_that_waited_gets_messages_again(streams: Streams, reader: socket.socket, said: Said) -> None:
    for _ in range(40):
        streams.send(STREAM, [MEGABYTE])
    reader.settimeout(0.05)
    with suppress(TimeoutError):
        while reader.recv(2**22):
            streams.poll()
    streams.send(STREAM, [b"news"])
    assert reader.recv(100)[4:] == b"news"
    assert len(said) == 1


def came_again(streams: Streams, seconds: float) -> int:
    """How often a client connects, as CARLA's does: at once, whenever its connection is closed."""
    until, connections = time.monotonic() + seconds, 0
    while time.monotonic() < until:
        connections += 1
        with socket.create_connection(("127.0.0.1", streams.port)) as reader:
            reader.send(struct.pack("<I", STREAM))
            reader.setblocking(False)
            while time.monotonic() < until:
                streams.poll(0.01)
                with suppress(BlockingIOError):
                    if not reader.recv(2**20):
                        break
    return connections


@pytest.mark.parametrize("was_there", [False, True], ids=["never there", "ended"])
def test_who_wants_a_stream_that_is_not_there_comes_once(streams: Streams, was_there: bool) -> None:
    if was_there:
        streams.token(STREAM)
        streams.close_stream(STREAM)
    assert came_again(streams, 1.0) == 1


def test_who_reads_a_stream_that_ends_does_not_come_again(streams: Streams, reader: socket.socket) -> None:
    assert reader.recv(100)
    streams.close_stream(STREAM)
    streams.poll(0.05)
    reader.settimeout(0.2)
    with pytest.raises(TimeoutError):  # neither a message nor an end
        reader.recv(100)
    assert not streams.is_wanted(STREAM)


def connected(streams: Streams, n: int) -> list[socket.socket]:
    """Connections that say nothing."""
    made = [socket.create_connection(("127.0.0.1", streams.port)) for _ in range(n)]
    streams.poll(0.05)
    return made


def is_closed(one: socket.socket) -> bool:
    one.setblocking(False)
    try:
        return not one.recv(100)
    except BlockingIOError:
        return False


def test_no_more_connections_to_ended_streams_are_kept_than_there_is_room_for(
    streams: Streams, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "MOST_PARKED", 2)
    made = connected(streams, 3)
    for one in made:
        one.send(struct.pack("<I", STREAM))
        streams.poll(0.05)
    assert [is_closed(one) for one in made] == [True, False, False]
    for one in made:
        one.close()


def test_who_says_nothing_locks_nobody_out(streams: Streams, said: Said, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST_SUBSCRIBERS", 2)
    monkeypatch.setattr(module, "SILENCE", 0.2)
    made = connected(streams, 4)
    assert [is_closed(one) for one in made] == [False, False, True, True]
    assert said == ["a subscriber was turned away (as there are 2)"]  # not twice
    time.sleep(0.3)
    [late] = connected(streams, 1)
    assert not is_closed(late)
    assert is_closed(made[0])
    for one in (*made, late):
        one.close()


@pytest.mark.parametrize("words", [bytes(5), struct.pack("<II", 5, 5)])
def test_who_says_more_than_a_number_harms_nobody(streams: Streams, words: bytes) -> None:
    with socket.create_connection(("127.0.0.1", streams.port)) as talker:
        talker.send(words)
        for _ in range(3):
            streams.poll(0.05)


def test_who_reads_slowly_is_waited_for(streams: Streams, reader: socket.socket, said: Said) -> None:
    for _ in range(15):
        streams.send(STREAM, [MEGABYTE])
    reader.setblocking(False)
    received = 0
    while received < 15_000_000:
        try:
            received += len(reader.recv(2**20))
        except BlockingIOError:
            streams.poll()
    streams.settle()
    assert streams.is_wanted(STREAM)
    assert said == []
