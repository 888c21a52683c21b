"""Requests out of bytes."""

from __future__ import annotations

import random
from itertools import chain

import msgpack
import pytest

from caldrive.carla_bridge.server.wire import MOST_BYTES, BrokenMessage, Request, Requests, answer, refused, served

TICK = msgpack.packb([0, 7, "tick_cue", [[False]]])
SPAWN = msgpack.packb([0, 8, "spawn_actor", [[True], [1, "vehicle.a", []], [[1, 2, 3], [0, 0, 0]]]])


def test_requests_may_come_in_any_pieces() -> None:
    requests, found = Requests(), []
    for byte in TICK + SPAWN:
        found += list(requests.feed(bytes([byte])))
    assert found[0] == Request(7, "tick_cue", [])
    assert (found[1].id, found[1].method) == (8, "spawn_actor")


@pytest.mark.parametrize(
    "message",
    [[1, 2, None, None], [0, 1, "tick_cue"], [0, 1, "tick_cue", []], [0, "a", "tick_cue", [[]]], 5, {}, None,
     [0, 1, b"tick", [[]]]],
)  # fmt: skip
def test_what_is_no_request_is_told_from_one(message: object) -> None:
    with pytest.raises(BrokenMessage):
        list(Requests().feed(msgpack.packb(message)))


def test_a_message_without_end_is_broken_before_it_takes_the_memory() -> None:
    requests = Requests()
    list(requests.feed(b"\xc6\xff\xff\xff\xff"))  # 4 GB of bytes follow
    piece = b"x" * (MOST_BYTES // 10)
    with pytest.raises(BrokenMessage):
        list(chain.from_iterable(requests.feed(piece) for _ in range(20)))


def test_a_message_nested_without_end_is_broken() -> None:
    with pytest.raises(BrokenMessage):
        list(Requests().feed(b"\x91" * 100_000))


def test_no_random_bytes_do_anything_but_break_their_connection() -> None:
    rng = random.Random(0)
    for _ in range(300):
        piece = bytearray(TICK + SPAWN)
        for _ in range(rng.randrange(1, 6)):
            piece[rng.randrange(len(piece))] = rng.randrange(256)
        try:
            found = list(Requests().feed(bytes(piece)))
        except BrokenMessage:
            continue
        assert all(isinstance(one, Request) for one in found)


def test_answers_are_wrapped_as_the_client_unwraps_them() -> None:
    assert msgpack.unpackb(answer(7, served(5, False))) == [1, 7, None, [[1, 5]]]
    assert msgpack.unpackb(answer(7, served(None, True))) == [1, 7, None, [[False]]]
    assert msgpack.unpackb(answer(7, refused("no", False))) == [1, 7, None, [[0, ["no"]]]]
    assert msgpack.unpackb(answer(7, refused("no", True))) == [1, 7, None, [[True, ["no"]]]]
