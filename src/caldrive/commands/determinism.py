"""The verbs that drive: an episode, a town on a page, the same episode twice."""

from __future__ import annotations

from dataclasses import asdict, dataclass

from caldrive.commands.answer import Answer, Output
from caldrive.driving.settings import DeterminismSettings
from caldrive.progress import Progress


@dataclass(frozen=True, kw_only=True)
class Determinism(DeterminismSettings, Output):
    def run(self, progress: Progress) -> Answer:
        from caldrive.driving.determinism import check_determinism

        found = check_determinism(self, progress)
        said = found.difference or f"equal in all {found.steps} steps, sha256 {found.digest[:16]}"
        return Answer(asdict(found) | {"equal": found.equal}, said, int(not found.equal))
