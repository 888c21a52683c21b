"""The verb that shows a town: on a contact sheet of camera images, as a plan to choose places from, or as a map."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from caldrive.commands.answer import Answer, Output
from caldrive.progress import Progress

SHEET = Path("out/town.png")  # where nothing was asked for by name


@dataclass(frozen=True, kw_only=True)
class Town(Output):
    """Show a town: a contact sheet, a plan to choose places from, or an OpenDRIVE map for other programs."""

    town: str = "town01"
    """town01, town02, random:SEED, random-wide:SEED or an OpenDRIVE file."""
    sheet: Path | None = None
    """A PNG file for camera images of the town in all weathers; out/town.png where nothing else is asked for."""
    plan: Path | None = None
    """A PNG file for a map with lanes, lights, signs and coordinates, to choose the places of caldrive drive --from
    X,Y --to X,Y from."""
    opendrive: Path | None = None
    """A .xodr file for the town as an OpenDRIVE map, which carla.Map and other programs read."""
    width: int | None = None
    """The width of each picture in pixels."""
    randomised: int = 0
    """Show the town on the sheet in so many random looks, as recordings have them, instead of the weathers."""

    def run(self, progress: Progress) -> Answer:
        """Draws and writes; answers with where the files are."""
        sheet = SHEET if self.sheet is None and self.plan is None and self.opendrive is None else self.sheet
        self._check(sheet)
        values: dict[str, Any] = {"town": self.town}
        lines = []
        if self.opendrive is not None:
            from caldrive.files import write_whole
            from caldrive.world.roads.opendrive_writer import write_opendrive
            from caldrive.world.roads.towns import load_roads

            progress("writing the map", 0.0)
            write_whole(self.opendrive, write_opendrive(load_roads(self.town)))
            values |= {"opendrive": str(self.opendrive)}
            lines.append(f"{self.town} as an OpenDRIVE map: {self.opendrive}")
        if self.plan is not None:
            from caldrive.visualization.town_plan import write_plan

            progress("drawing the plan", 0.0)
            width, height = write_plan(self.town, self.plan, self.width)
            values |= {"plan": str(self.plan), "plan_width": width, "plan_height": height}
            lines.append(f"plan of {self.town}: {self.plan} ({width} x {height})")
        if sheet is not None:
            from caldrive.visualization.contact_sheet import write_sheet

            progress("drawing the sheet", 0.1)
            width, height = write_sheet(self.town, sheet, self.width, self.randomised)
            values |= {"sheet": str(sheet), "width": width, "height": height}
            lines.append(f"{self.town} on one page: {sheet} ({width} x {height})")
        values |= _of_map(self.town)
        return Answer(values, "\n".join(lines))

    def _check(self, sheet: Path | None) -> None:
        """Raises ValueError or OSError where a file cannot be, before the other one is written."""
        from caldrive.checks import MOST_LOOKS, require_within, require_writable_file

        files = (("--sheet", sheet, ".png"), ("--plan", self.plan, ".png"), ("--opendrive", self.opendrive, ".xodr"))
        for option, path, ending in files:
            if path is not None:
                require_writable_file(path, option, ending)
        if self.opendrive is not None and self.town.endswith(".xodr"):
            raise ValueError(
                f"found --opendrive for {self.town}, wanted a town of caldrive's own, as it is such a map already: "
                "type --town town01"
            )
        if self.plan is not None and sheet is not None and self.plan.resolve() == sheet.resolve():
            raise ValueError(f"found {sheet} for the sheet and for the plan, wanted two files: type another --plan")
        require_within("--randomised", self.randomised, 0, MOST_LOOKS, 8)
        if self.randomised and sheet is None:
            raise ValueError(
                "found --randomised without --sheet, wanted both, as a plan has no looks: type --sheet FILE"
            )


def _of_map(town: str) -> dict[str, Any]:
    """What was left out of a map, and where it lies, for programs; people are told when it is loaded."""
    from caldrive.world.roads.towns import load_roads

    roads = load_roads(town)
    return {"left_out": list(roads.dropped), "offset": list(roads.offset)}
