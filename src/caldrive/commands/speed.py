"""The verbs that measure how fast things are."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from caldrive.commands.answer import Answer, Output
from caldrive.driving.settings import AgentSpeedSettings, WorldSpeedSettings
from caldrive.files import read_json
from caldrive.progress import Progress

if TYPE_CHECKING:  # `speed world` times the imports, too: nothing is loaded before it
    from caldrive.driving.speed import AgentTiming, WorldTiming

Timing = TypeVar("Timing", "AgentTiming", "WorldTiming")


@dataclass(frozen=True, kw_only=True)
class Compared(Output):
    """A measurement that may be compared with an earlier one."""

    against: Path | None = None
    """What --json said of an earlier run on this processor: adds by how many times it is faster now."""


@dataclass(frozen=True, kw_only=True)
class WorldSpeed(WorldSpeedSettings, Compared):
    """Camera steps a second, and where the time goes."""

    def run(self, progress: Progress) -> Answer:
        """Measures; answers with milliseconds for each part of a step."""
        from caldrive.driving.speed import WorldTiming, measure_world

        before = None if self.against is None else earlier(self.against, WorldTiming)
        speed = measure_world(self, progress)
        from caldrive.commands.tables import world_table

        ratios = {}
        if before is not None:
            parts = {name: before.parts_ms[name] / ms for name, ms in speed.parts_ms.items() if name in before.parts_ms}
            ratios = parts | {"whole step": before.median_ms / speed.median_ms}
            ratios["steps a second"] = speed.steps_per_second / before.steps_per_second
            _require_same(before.processor, speed.processor)
        return Answer(asdict(speed) | ({"ratios": ratios} if ratios else {}), world_table(speed, ratios))


@dataclass(frozen=True, kw_only=True)
class AgentSpeed(AgentSpeedSettings, Compared):
    """Milliseconds from image to control, while the agent drives among others in town01."""

    def run(self, progress: Progress) -> Answer:
        """Measures; answers with the median and the 99th percentile."""
        from caldrive.driving.speed import AgentTiming, measure_agent

        before = None if self.against is None else earlier(self.against, AgentTiming)
        speed = measure_agent(self, progress)
        values = asdict(speed)
        said = (
            f"from image to control: {speed.median_ms:.1f} ms at the median, {speed.p99_ms:.1f} ms in 99 of 100 cases "
            f"({speed.width} x {speed.height}, {speed.processor})"
        )
        if before is not None:
            _require_same(before.processor, speed.processor)
            values["ratios"] = {"median": before.median_ms / speed.median_ms}
            said += f"; {before.median_ms / speed.median_ms:.2f} times as fast as before"
        return Answer(values, said)


def earlier(path: Path, kind: type[Timing]) -> Timing:
    """A measurement that --json printed. Raises ValueError where the file is none."""
    try:
        return read_json(path.read_bytes(), kind)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise ValueError(
            f"found in {path} no measurement ({reason}), wanted what the same command printed with --json: "
            "type caldrive speed world --json > FILE"
        ) from error


def _require_same(before: str, now: str) -> None:
    """Raises ValueError for measurements of two processors."""
    if before != now:
        raise ValueError(
            f"found a measurement of {before}, and this is {now}: only runs on one machine can be compared; "
            "leave out --against"
        )
