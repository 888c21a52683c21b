"""CARLA's dialect of msgpack-rpc: requests out of a stream of bytes, and answers.

A request is `[0, id, method, [metadata, *arguments]]`, an answer `[1, id, None, result]`. CARLA wraps results once
more: `[[1, value]]`, or `[[0, [text]]]` where it refuses; without a value `[[False]]` and `[[True, [text]]]`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import msgpack
from msgspec.msgpack import Encoder

MOST_BYTES = 16_000_000  # of one message; a map that a client sends has a few
_ENCODER = Encoder(enc_hook=float)  # for numbers of numpy


class Refusal(Exception):  # noqa: N818 (it is no error of the program)
    """What a client asks for is not served; the text is for whoever sits before it."""


class BrokenMessage(Exception):  # noqa: N818
    """Bytes that are no request."""


class Request(NamedTuple):
    """A call."""

    id: int
    method: str
    arguments: list[Any]
    is_heard: bool = True
    """Whether the client waits for the answer."""


class Requests:
    """The requests of one connection, out of the bytes as they come."""

    def __init__(self) -> None:
        self._unpacker = msgpack.Unpacker(raw=False, strict_map_key=False, max_buffer_size=MOST_BYTES)

    def feed(self, received: bytes) -> Iterator[Request]:
        """The requests that are complete now. Raises BrokenMessage, after which nothing of the connection can be read
        any more."""
        try:
            self._unpacker.feed(received)
            for message in self._unpacker:
                yield _request(message)
        except (msgpack.UnpackException, ValueError, TypeError, RecursionError, OverflowError) as error:
            raise BrokenMessage(f"{type(error).__name__}: {error}" if str(error) else type(error).__name__) from error


def _request(message: Any) -> Request:
    match message:
        case [0, int(id), str(method), [metadata, *arguments]]:
            return Request(id, method, arguments, is_heard=metadata != [True])
        case _:
            raise BrokenMessage(f"a {type(message).__name__} that is no request")


def encode(value: Any) -> bytes:
    """A value as msgpack."""
    return _ENCODER.encode(value)


def answer(id: int, result: Any) -> bytes:
    """The answer to a request with a result that is wrapped already."""
    return _ENCODER.encode((1, id, None, result))


def served(value: Any, is_void: bool) -> Any:
    """A result that a client understands as success."""
    return ((False,),) if is_void else ((1, value),)


def refused(text: str, is_void: bool) -> Any:
    """A result that a client raises as RuntimeError with this text."""
    return ((True, (text,)),) if is_void else ((0, (text,)),)


def refusal_in(result: Any) -> str | None:
    """The text of such a result, None of another."""
    match result:
        case ((True | 0, (str(text),)),):
            return text
    return None
