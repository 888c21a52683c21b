"""What a server says on stderr, and how it says the same thing not too often."""

from __future__ import annotations

import sys
import time
from contextlib import suppress

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
