"""The verbs that measure how fast things are."""

from __future__ import annotations

from dataclasses import asdict, dataclass

from caldrive.commands.answer import Answer, Output
from caldrive.driving.settings import AgentSpeedSettings, WorldSpeedSettings
from caldrive.progress import Progress


@dataclass(frozen=True, kw_only=True)
class WorldSpeed(WorldSpeedSettings, Output):
    """Camera steps a second, and where the time goes."""

    def run(self, progress: Progress) -> Answer:
        """Measures; answers with milliseconds for each part of a step."""
        from caldrive.driving.speed import measure_world

        speed = measure_world(self, progress)  # times the imports, too: nothing is loaded before it
        from caldrive.commands.tables import world_table

        return Answer(asdict(speed), world_table(speed))


@dataclass(frozen=True, kw_only=True)
class AgentSpeed(AgentSpeedSettings, Output):
    """Milliseconds from image to control."""

    def run(self, progress: Progress) -> Answer:
        """Measures; answers with the median and the 99th percentile."""
        from caldrive.driving.speed import measure_agent

        speed = measure_agent(self, progress)
        said = (
            f"from image to control: {speed.median_ms:.1f} ms at the median, {speed.p99_ms:.1f} ms in 99 of 100 cases"
        )
        return Answer(asdict(speed), f"{said} ({speed.width} x {speed.height})")
