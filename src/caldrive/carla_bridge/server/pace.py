"""When the clock moves the world: not while it stands at its beginning, so that each program finds the same one."""

from __future__ import annotations

import math
import time

FREE_STEP = 0.05  # s of a step by the clock, as CARLA's at 20 frames a second
FIRST_FRAME = 0.3  # s after a call until a new world shows its first frame, for which a client waits that connects
GRACE = 1.0  # s after a call until the clock begins to move the world: time to ask for synchronous mode
LONGEST_GRACE = 5.0  # s after the first call


class Pace:
    """stands: whether the world is at its beginning. A client that connects or loads a world waits for a frame, so that
    one comes after a while, without a step; then the clock waits again."""

    def __init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        """A world that nobody has asked for anything yet."""
        self.stands, self.owes_frame, self._is_loaded = True, True, False
        self._first_call, self._next = math.inf, math.inf  # s by the clock

    def begin_loaded(self) -> None:
        """A world that a client has loaded: it asks for the settings until the frame has come."""
        self.begin()
        self._is_loaded, self._next = True, time.monotonic() + GRACE

    def hear(self) -> None:
        """A client calls: where the world stands, the clock waits for its next call."""
        if not self.stands or (self.owes_frame and self._is_loaded):
            return
        now = time.monotonic()
        self._first_call = min(self._first_call, now)
        patience, most = (FIRST_FRAME, GRACE) if self.owes_frame else (GRACE, LONGEST_GRACE)
        self._next = min(now + patience, self._first_call + most)

    def left(self) -> float:
        """s until something is due by the clock."""
        return max(0.0, self._next - time.monotonic())

    def show(self) -> None:
        """The first frame has gone out."""
        self.owes_frame = False
        self.hear()

    def step(self, delta: float | None) -> None:
        """The clock moves the world, by delta seconds or as usual."""
        self._next = max(self._next + (delta or FREE_STEP), time.monotonic())
        self.stands = False

    def go_on(self) -> None:
        """Other rules hold: what was due meanwhile is not made up for."""
        self._next = max(self._next, time.monotonic())
