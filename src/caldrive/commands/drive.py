"""The verb that drives episodes."""

from __future__ import annotations

from dataclasses import dataclass

from caldrive.commands.answer import Answer, Output
from caldrive.driving.settings import DriveSettings
from caldrive.progress import Progress


@dataclass(frozen=True, kw_only=True)
class Drive(DriveSettings, Output):
    strict: bool = False
    """End with exit code 1 unless every episode reached its goal."""

    def run(self, progress: Progress) -> Answer:
        from caldrive.commands.tables import drive_table
        from caldrive.driving.drive import drive

        report = drive(self, progress)
        return Answer(report.values(), drive_table(report), int(self.strict and not report.all_reached))
