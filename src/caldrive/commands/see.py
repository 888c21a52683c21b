"""The verb that runs the network on a person's own pictures."""

from __future__ import annotations

from dataclasses import dataclass

from caldrive.commands.answer import Answer, Output
from caldrive.driving.settings import SeeSettings
from caldrive.progress import Progress


@dataclass(frozen=True, kw_only=True)
class See(SeeSettings, Output):
    """Let the network look at pictures of your own."""

    def run(self, progress: Progress) -> Answer:
        """Looks at the pictures; answers with where the video and the values are."""
        from caldrive.driving.see import see

        report = see(self, progress)
        values = {
            "video": str(report.video), "values": str(report.values), "pictures": report.pictures,
            "no_use": report.no_use, "notes": list(report.notes),
        }  # fmt: skip
        no_use = f", {report.no_use} of no use" if report.no_use else ""
        written = f"seen: {report.pictures} pictures{no_use}; video: {report.video}; values: {report.values}"
        return Answer(values, "\n".join((written, *report.notes)))
