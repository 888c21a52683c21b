"""The verbs that drive: an episode, a town on a page, the same episode twice."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path

from caldrive.commands.answer import Answer, Output
from caldrive.driving.settings import DeterminismSettings, DriveSettings
from caldrive.progress import Progress


@dataclass(frozen=True)
class Drive(DriveSettings, Output):
    strict: bool = False
    """End with exit code 1 unless every episode reached its goal."""

    def run(self, progress: Progress) -> Answer:
        from caldrive.driving.drive import drive
        from caldrive.driving.tables import drive_table

        report = drive(self, progress)
        return Answer(report.values(), drive_table(report), int(self.strict and not report.all_reached))


@dataclass(frozen=True)
class Town(Output):
    town: str = "town01"
    """town01, town02 or an OpenDRIVE file."""
    sheet: Path = Path("out/town.png")
    """The PNG file to write."""
    width: int | None = None
    """Its width in pixels."""
    looks: int = 0
    """Show so many of the made-up looks that recordings give the town, instead of the weathers."""

    def run(self, progress: Progress) -> Answer:
        from caldrive.driving.sheet import write_sheet

        progress("drawing", 0.0)
        width, height = write_sheet(self.town, self.sheet, self.width, self.looks)
        values = {"town": self.town, "sheet": str(self.sheet), "width": width, "height": height}
        return Answer(values, f"{self.town} on one page: {self.sheet} ({width} x {height})")


@dataclass(frozen=True)
class Determinism(DeterminismSettings, Output):
    def run(self, progress: Progress) -> Answer:
        from caldrive.driving.determinism import check_determinism

        found = check_determinism(self, progress)
        said = found.difference or f"equal in all {found.steps} steps, sha256 {found.digest[:16]}"
        return Answer(asdict(found) | {"equal": found.equal}, said, int(not found.equal))
