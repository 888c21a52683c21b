"""What a server says on stderr, and how it says the same thing not too often."""

from __future__ import annotations

import sys
import time
from contextlib import suppress
from typing import Any

from caldrive.carla_bridge.server.wire import Request, refusal_in

MOST_KINDS = 100  # of refusals to a client, who might invent names
QUIET = 60.0  # s until the same may be said again


class Log:
    """Says sentences, if anybody can hear them."""

    def __init__(self) -> None:
        self._said: dict[str, float] = {}  # s at which something was said that others could bring about at will

    def __call__(self, sentence: str) -> None:
        """Says one."""
        with suppress(OSError, ValueError):
            print(f"caldrive: {sentence}", file=sys.stderr, flush=True)

    def rarely(self, what: str, why: str) -> None:
        """Says what happened and why, unless the same happened a moment ago. what: one of a few words."""
        now = time.monotonic()
        if now - self._said.get(what, -QUIET) >= QUIET:
            self._said[what] = now
            self(f"{what} ({why})")


class Refusals:
    """What is refused to clients that do not wait for an answer: their programs go on as if it were done, and only the
    server can say it, each kind once for a client."""

    def __init__(self, log: Log) -> None:
        self._log = log
        self._said: dict[int, set[str]] = {}  # methods, by client

    def note(self, caller: int, request: Request, result: Any) -> None:
        """A call has a result. That of a batch is a list of those of its commands."""
        if request.is_heard:
            return
        parts = result if isinstance(result, list) else [result]
        text = next((text for text in map(refusal_in, parts) if text is not None), None)
        said = self._said.setdefault(caller, set())
        if text is not None and request.method not in said and len(said) < MOST_KINDS:
            said.add(request.method)
            self._log(f"{request.method[:80]} of a client was refused, which does not hear of it, once or more: {text}")

    def forget(self, caller: int) -> None:
        """A client has gone."""
        self._said.pop(caller, None)
