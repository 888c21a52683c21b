"""Bytes on their way to a client: what its socket does not take at once waits, and nobody waits for it."""

from __future__ import annotations

import socket
from collections import deque
from collections.abc import Sequence
from itertools import islice
from typing import Any

KEEPALIVE = {  # s of silence before the first probe, s between two, and how many stay unanswered before the end
    socket.TCP_KEEPIDLE: 30, socket.TCP_KEEPINTVL: 10, socket.TCP_KEEPCNT: 3,
}  # fmt: skip
AT_ONCE = 16  # pieces that are handed to the system together


class Gone(Exception):  # noqa: N818
    """Nobody is at the other end any more."""


class Outbox:
    """What one socket still has to send. waiting: bytes of it."""

    def __init__(self, stream: socket.socket) -> None:
        self._socket, self.waiting = stream, 0
        self._pieces: deque[memoryview] = deque()

    def put(self, pieces: Sequence[Any]) -> None:
        """Sends pieces of bytes, or keeps what cannot be sent now. They must not change any more. Raises Gone."""
        views = [view for piece in pieces if (view := memoryview(piece).cast("B"))]  # none of them empty
        self._pieces.extend(views)
        self.waiting += sum(len(view) for view in views)
        self.flush()

    def flush(self) -> None:
        """Sends what the socket takes now. Raises Gone."""
        while self._pieces:
            try:
                sent = self._socket.sendmsg(list(islice(self._pieces, AT_ONCE)))
            except (BlockingIOError, InterruptedError):
                return
            except OSError as error:
                raise Gone from error
            self.waiting -= sent
            while sent and sent >= len(self._pieces[0]):
                sent -= len(self._pieces.popleft())
            if sent:
                self._pieces[0] = self._pieces[0][sent:]


def listening(host: str, port: int) -> socket.socket:
    """A socket that waits for clients. Raises OSError where the port is another's."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    waiting = socket.socket(family, socket.SOCK_STREAM)
    try:
        waiting.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        waiting.bind((host, port))
        waiting.listen(64)
        waiting.setblocking(False)
    except (OSError, OverflowError) as error:
        waiting.close()
        raise OSError(
            f"found that {host}:{port} cannot be listened on ({getattr(error, 'strerror', None) or error}), wanted a "
            "free port: type another --port"
        ) from error
    return waiting


def accepted(waiting: socket.socket) -> socket.socket | None:
    """The next client's connection, None where there is none."""
    try:
        stream, _ = waiting.accept()
    except OSError:
        return None
    stream.setblocking(False)
    stream.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    stream.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)  # of a machine that vanished nothing is heard
    for option, value in KEEPALIVE.items():
        stream.setsockopt(socket.IPPROTO_TCP, option, value)
    return stream
