"""What is refused to clients that do not wait for an answer: their programs go on as if it were done, and only the
server can say it."""

from __future__ import annotations

from typing import Any

from caldrive.carla_bridge.server.log import Log
from caldrive.carla_bridge.server.wire import Request, refusal_in

MOST_KINDS = 100  # for a client, who might invent names


class Refusals:
    """Says each kind once for a client."""

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
