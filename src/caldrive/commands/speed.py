"""The verbs that measure how fast things are."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from caldrive.checks import require_modules
from caldrive.commands.answer import Answer, Output
from caldrive.driving.settings import AgentSpeedSettings, EnvSpeedSettings, WorldSpeedSettings
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
        from caldrive.driving.speed import WorldTiming, measure_world, scene_of

        before = None if self.against is None else earlier(self.against, WorldTiming)
        if before is not None and before.scene != scene_of(self):
            raise ValueError(
                f"found a measurement of {before.scene}, wanted one of {scene_of(self)}: give the options that it had"
            )
        speed = measure_world(self, progress)
        from caldrive.commands.tables import world_table

        ratios = {} if before is None else before.over(speed)
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
            values["ratios"] = {"median": before.median_ms / speed.median_ms}
            said += f"; {before.median_ms / speed.median_ms:.2f} times as fast as before"
        return Answer(values, said)


@dataclass(frozen=True, kw_only=True)
class EnvSpeed(EnvSpeedSettings, Output):
    """Steps a second of the gymnasium environment in town01, resets included."""

    def run(self, progress: Progress) -> Answer:
        """Measures; answers with the steps a second of all environments together."""
        require_modules("gym", "gymnasium")
        from caldrive.gym.speed import measure_env

        speed = measure_env(self, progress)
        several = f" of {speed.environments} environments together" if speed.environments > 1 else ""
        return Answer(asdict(speed), f"{speed.steps_per_second:.0f} steps a second{several} ({speed.processor})")


def earlier(path: Path, kind: type[Timing]) -> Timing:
    """A measurement that --json printed. Raises ValueError where the file is none, or of another processor."""
    from caldrive.driving.speed import processor_name

    try:
        before = read_json(path.read_bytes(), kind)
        if before.median_ms <= 0:
            raise ValueError("its steps took no time")
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise ValueError(
            f"found in {path} no measurement ({reason}), wanted what the same command printed with --json: "
            "type caldrive speed world --json > FILE"
        ) from error
    if before.processor != processor_name():
        raise ValueError(
            f"found a measurement of {before.processor}, and this is {processor_name()}: only runs on one machine can "
            "be compared; leave out --against"
        )
    return before
