"""Streams and those who read them too slowly, or not at all."""

from __future__ import annotations

import socket
import struct
import time
from collections.abc import Iterator
from contextlib import suppress

import pytest

from caldrive.carla_bridge.server import streams as module
from caldrive.carla_bridge.server.outbox import listening
from caldrive.carla_bridge.server.streams import Streams

STREAM = 5
MEGABYTE = bytes(1_000_000)


@pytest.fixture
def said() -> list[str]:
    return []


@pytest.fixture
def streams(said: list[str], monkeypatch: pytest.MonkeyPatch) -> Iterator[Streams]:
    monkeypatch.setattr(module, "MOST_WAITING", 20_000_000)
    monkeypatch.setattr(module, "PATIENCE", 0.2)
    monkeypatch.setattr(module, "STALLED", 0.2)
    made = Streams(listening("127.0.0.1", 0), said.append, newcomer=lambda stream: [b"first"])
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


def test_who_does_not_read_misses_messages_and_is_cut_off(
    streams: Streams, reader: socket.socket, said: list[str]
) -> None:
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


def test_whoever_reads_all_that_waited_gets_messages_again(
    streams: Streams, reader: socket.socket, said: list[str]
) -> None:
    for _ in range(40):
        streams.send(STREAM, [MEGABYTE])
    reader.settimeout(0.05)
    with suppress(TimeoutError):
        while reader.recv(2**22):
            streams.poll()
    streams.send(STREAM, [b"news"])
    assert reader.recv(100)[4:] == b"news"
    assert len(said) == 1


@pytest.mark.parametrize("was_there", [False, True], ids=["never there", "ended"])
def test_who_wants_a_stream_that_is_not_there_is_sent_away(streams: Streams, was_there: bool) -> None:
    """Or it would wait for ever, and count among the subscribers."""
    if was_there:
        streams.token(STREAM)
        streams.close_stream(STREAM)
    with socket.create_connection(("127.0.0.1", streams.port)) as late:
        late.send(struct.pack("<I", STREAM))
        late.settimeout(5.0)
        for _ in range(3):
            streams.poll(0.05)
        assert late.recv(100) == b""


@pytest.mark.parametrize("words", [bytes(5), struct.pack("<II", 5, 5)])
def test_who_says_more_than_a_number_harms_nobody(streams: Streams, words: bytes) -> None:
    with socket.create_connection(("127.0.0.1", streams.port)) as talker:
        talker.send(words)
        for _ in range(3):
            streams.poll(0.05)


def test_who_reads_slowly_is_waited_for(streams: Streams, reader: socket.socket, said: list[str]) -> None:
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
