"""The verbs that drive: episodes, and the same episode twice."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from caldrive.commands.answer import Answer, Configurable
from caldrive.driving.settings import DeterminismSettings, DriveSettings
from caldrive.progress import Progress


@dataclass(frozen=True, kw_only=True)
class Drive(DriveSettings, Configurable):
    """Drive episodes, film them, and write down what happened."""

    attention: str | None = None
    """An affordance, or a class such as speed_sign=60, whose attention is recorded beside the camera with --record or
    --view: where the network of caldrive explain looks."""
    strict: bool = False
    """End with exit code 1 unless every episode reached its goal."""

    def run(self, progress: Progress) -> Answer:
        """Drives; answers with a row for each episode."""
        from caldrive.commands.tables import drive_table
        from caldrive.driving.drive import drive

        report = drive(self, progress, self._attention())
        return Answer(report.values(), drive_table(report), int(self.strict and not report.all_reached))

    def _attention(self) -> Any:
        """What draws the attention, where it is asked for. Raises ValueError where nothing would show it, and where it
        cannot be drawn."""
        if self.attention is None:
            return None
        if self.record is None and not self.view:
            raise ValueError(
                f"found --attention {self.attention} in a drive that is not recorded, wanted --record or --view: type "
                "--record out/drive.mcap, or caldrive explain drive for a film"
            )
        from caldrive.agents.registry import agent_entry
        from caldrive.datatypes import CameraConfig
        from caldrive.explain.live_attention import LiveAttention

        camera = agent_entry(self.agent).camera(self) or CameraConfig()
        return LiveAttention(self.attention, camera, self.model if self.agent == "cal" else None)


@dataclass(frozen=True, kw_only=True)
class Determinism(DeterminismSettings, Configurable):
    """Drive the same episode in two fresh processes and compare all bytes."""

    def run(self, progress: Progress) -> Answer:
        """Drives twice; answers with the first difference, and 1 where there is one."""
        from caldrive.driving.determinism import check_determinism

        found = check_determinism(self, progress)
        said = found.difference or f"equal in all {found.steps} steps, sha256 {found.digest[:16]}"
        return Answer(asdict(found) | {"equal": found.equal}, said, int(not found.equal))
