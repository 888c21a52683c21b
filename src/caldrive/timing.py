"""Where the time goes: a stopwatch that a world or an agent can be given, to measure the parts of a step."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from statistics import median
from time import perf_counter

Timed = Callable[[str], AbstractContextManager[None]]  # with timed("camera"): ...


def untimed(part: str) -> AbstractContextManager[None]:
    """Measures nothing."""
    return nullcontext()


class Stopwatch:
    """Seconds that each part takes in each lap. Parts must not lie inside one another; each may come several times."""

    def __init__(self) -> None:
        self.laps: list[dict[str, float]] = []
        self._lap: dict[str, float] = defaultdict(float)

    @contextmanager
    def part(self, name: str) -> Iterator[None]:
        """The time inside this block counts for a part."""
        begin = perf_counter()
        try:
            yield
        finally:
            self._lap[name] += perf_counter() - begin

    def restart(self) -> None:
        """Forget all laps so far."""
        self.laps.clear()
        self._lap.clear()

    def lap(self, whole: float) -> None:
        """Ends a lap that took `whole` seconds in all; what no part took is the rest."""
        self._lap["rest"] = whole - sum(self._lap.values())
        self.laps.append(dict(self._lap))
        self._lap.clear()

    def medians(self) -> dict[str, float]:
        """Median seconds a lap of each part."""
        parts = {name for lap in self.laps for name in lap}
        return {name: median(lap.get(name, 0.0) for lap in self.laps) for name in sorted(parts)}
