"""The verbs that drive: an episode, a town on a page, the same episode twice."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from caldrive.commands.answer import Answer, Output
from caldrive.progress import Progress


@dataclass(frozen=True, kw_only=True)
class Town(Output):
    town: str = "town01"
    """town01, town02 or an OpenDRIVE file."""
    sheet: Path = Path("out/town.png")
    """The PNG file to write."""
    width: int | None = None
    """Its width in pixels."""
    randomised: int = 0
    """Show the town in so many random looks, as recordings have them, instead of the weathers."""

    def run(self, progress: Progress) -> Answer:
        from caldrive.visualization.contact_sheet import write_sheet

        progress("drawing", 0.0)
        width, height = write_sheet(self.town, self.sheet, self.width, self.randomised)
        values = {"town": self.town, "sheet": str(self.sheet), "width": width, "height": height}
        return Answer(values, f"{self.town} on one page: {self.sheet} ({width} x {height})")
