"""A town's map on paper: lanes with their directions, junctions, lights and signs over a grid in metres, north up.

From it a person reads off the places for `caldrive drive --from X,Y --to X,Y`.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image as Picture

from caldrive.checks import MOST_PIXELS, require_within, require_writable_file
from caldrive.datatypes import Image, Points, Pose
from caldrive.files import write_figure
from caldrive.geometry import box_corners, moved, to_world
from caldrive.world.roads.network import Lane, RoadNetwork
from caldrive.world.roads.towns import load_roads

USUAL_WIDTH, LEAST_WIDTH = 1600, 1000  # pixels
DPI = 100
FLATTEST, STEEPEST = 0.3, 1.4  # the map's height in its widths; a flatter or steeper town gets free ground around it
AROUND = 0.04  # free ground around the roads, as a share of the longer side
EDGES = (88, 34, 70, 146)  # pixels left, right, above and below the map, for the figures and the words
LINE = 23  # pixels of one more line below
STEPS = 9  # labelled lines of the grid from west to east, about
PARTS = {1: 5, 2: 4, 5: 5}  # how many parts a step of the grid has, by its first digit, so that they are round, too
NARROWEST = 3.0  # pixels that the thinnest road is drawn wide
ARROW_EVERY, ARROW_LEAST = 72.0, 9.0  # pixels from an arrow to the next, and of the smallest one
ROAD, JUNCTION, MIDDLE, ARROW = "#c3c9d1", "#a3acb8", "#ffffff", "#2f4a6d"
STOP, SIGN, POST = "#d0342c", "#d0342c", "#15181d"
LAMPS = ("#ff4136", "#ffc83d", "#35d06f")
ARROW_SHAPE = np.array([(0.5, 0.0), (-0.5, 0.36), (-0.28, 0.0), (-0.5, -0.36)])  # ahead is x


def grid_steps(span: float) -> tuple[float, float]:
    """The metres from one labelled line to the next (1, 2 or 5 times a power of ten, for about STEPS lines in a span),
    and from one fine line to the next."""
    wanted = span / STEPS
    power = 10.0 ** math.floor(math.log10(wanted))
    steps = {factor * scale: parts for scale in (power, 10 * power) for factor, parts in PARTS.items()}
    step = min(steps, key=lambda step: abs(math.log(step / wanted)))
    return step, step / steps[step]


def map_bounds(roads: RoadNetwork) -> tuple[float, float, float, float]:
    """x_min, y_min, x_max, y_max of the map in metres: the roads, free ground around them, a shape that fits a page."""
    x0, y0, x1, y1 = roads.bounds
    margin = max(AROUND * max(x1 - x0, y1 - y0), 6.0)
    width, height = x1 - x0 + 2 * margin, y1 - y0 + 2 * margin
    height = max(height, FLATTEST * width)
    width = max(width, height / STEEPEST)
    x, y = (x0 + x1) / 2, (y0 + y1) / 2
    return x - width / 2, y - height / 2, x + width / 2, y + height / 2


def example_places(roads: RoadNetwork) -> tuple[Pose, Pose]:
    """Two places on the longest lane, from the first of which the second can be reached."""
    line = max(roads.driveable, key=lambda lane: lane.line.length).line
    return line.pose_at(0.2 * line.length), line.pose_at(0.8 * line.length)


class TownPlan:
    """Draws one town's map. width: of the picture in pixels; the height follows from the town's shape."""

    def __init__(self, roads: RoadNetwork, width: int = USUAL_WIDTH) -> None:
        from matplotlib.figure import Figure

        self.roads, self.bounds = roads, map_bounds(roads)
        x0, y0, x1, y1 = self.bounds
        self.steps = grid_steps(min(x1 - x0, 2 * (y1 - y0)))
        self.notes = notes(roads)
        left, right, above, below = EDGES
        below += LINE * len(self.notes)
        self.scale = (width - left - right) / (x1 - x0)  # pixels in a metre
        height = round((y1 - y0) * self.scale) + above + below
        self.figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI, facecolor="white")
        box = (left / width, below / height, 1 - (left + right) / width, 1 - (above + below) / height)
        self.ax = self.figure.add_axes(box, xlim=(x0, x1), ylim=(y0, y1))

    def draw(self, how_to: str) -> Any:
        """The finished figure. how_to: what stands below the map, before what is to be known of it."""
        self._draw_grid()
        self._draw_lanes()
        self._draw_arrows()
        self._draw_lights()
        self._draw_signs()
        self._write("\n".join([*how_to.splitlines(), *self.notes]))
        return self.figure

    def picture(self, how_to: str) -> Image:
        """The finished map as a picture (H, W, 3)."""
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        canvas: Any = FigureCanvasAgg(self.draw(how_to))
        canvas.draw()
        return np.asarray(canvas.buffer_rgba())[..., :3]

    def metres(self, pixels: float) -> float:
        """How long so many pixels are on the map."""
        return pixels / self.scale

    def _draw_grid(self) -> None:
        """Labelled lines and finer ones between, over the roads, with figures on all four sides."""
        from matplotlib.ticker import MultipleLocator

        step, fine = self.steps
        for axis in (self.ax.xaxis, self.ax.yaxis):
            axis.set_major_locator(MultipleLocator(step))
            axis.set_minor_locator(MultipleLocator(fine))
            axis.set_major_formatter(lambda value, _: f"{value:g}")  # as it is typed, with a hyphen for a minus
        self.ax.grid(which="major", color="#1b2733", alpha=0.45, lw=0.8, zorder=4)
        self.ax.grid(which="minor", color="#1b2733", alpha=0.16, lw=0.5, zorder=4)
        self.ax.set_axisbelow(False)
        self.ax.tick_params(labelsize=11, top=True, labeltop=True, right=True, which="major")

    def _draw_lanes(self) -> None:
        """The asphalt, darker in junctions, and a white line along the edges of every lane outside."""
        from matplotlib.collections import LineCollection, PolyCollection

        lanes = self.roads.driveable
        junctions = [_outline(lane) for lane in self.roads.lanes.values() if lane.internal]
        thin = max(1.0, self.scale * min(lane.width for lane in lanes))  # pixels
        points = 72 / DPI  # of a pixel: matplotlib counts widths of lines in points
        self.ax.add_collection(PolyCollection(junctions, facecolor=JUNCTION, edgecolor=JUNCTION, lw=0.5, zorder=1))
        self.ax.add_collection(
            LineCollection([lane.line.points for lane in lanes], color=ROAD, lw=NARROWEST * points, zorder=1)
        )
        self.ax.add_collection(
            PolyCollection(
                [_outline(lane) for lane in lanes], facecolor=ROAD, edgecolor=MIDDLE, lw=min(1.2, 0.1 * thin) * points,
                zorder=2,
            )
        )  # fmt: skip

    def _draw_arrows(self) -> None:
        """Arrows along the lanes; a lane that is too short for one has none."""
        from matplotlib.collections import PolyCollection

        arrows = []
        for lane in self.roads.driveable:
            size = max(0.8 * lane.width, self.metres(ARROW_LEAST))
            if lane.line.length < 2 * size:
                continue
            spacing = max(self.metres(ARROW_EVERY), 2 * size)
            n_arrows = max(1, round(lane.line.length / spacing))
            places = (np.arange(n_arrows) + 0.5) * lane.line.length / n_arrows
            arrows += [to_world(lane.line.pose_at(s), ARROW_SHAPE * size) for s in places]
        self.ax.add_collection(PolyCollection(arrows, facecolor=ARROW, edgecolor="none", zorder=5))

    def _draw_lights(self) -> None:
        """A post with its three lamps, and the stop line that belongs to it."""
        for post in self.roads.posts:
            (x, y), (u, v) = post.stop_line
            self.ax.plot((x, u), (y, v), color=STOP, lw=2.2, solid_capstyle="butt", zorder=5)
            corners = box_corners(post.stands_at, self.metres(15), self.metres(7))
            self.ax.fill(corners[:, 0], corners[:, 1], color=POST, zorder=6)
            for k, color in enumerate(LAMPS):
                lamp = moved(post.stands_at, forward=self.metres(4.4 * (1 - k)))
                self.ax.plot(lamp.x, lamp.y, ".", color=color, ms=3.4, mew=0, zorder=7)

    def _draw_signs(self) -> None:
        """A round sign beside the road, with a line to the foot of its post."""
        for sign in self.roads.signs:
            foot, disc = sign.stands_at, moved(sign.stands_at, left=-self.metres(14))
            self.ax.plot((foot.x, disc.x), (foot.y, disc.y), color=POST, lw=1, zorder=6)
            self.ax.plot(disc.x, disc.y, "o", ms=14, mfc="white", mec=SIGN, mew=1.8, zorder=7)
            self.ax.text(disc.x, disc.y, str(sign.limit), fontsize=7.5, ha="center", va="center_baseline", zorder=8)

    def _write(self, how_to: str) -> None:
        """The name, what the axes and the marks mean, and what to type."""
        self.ax.set_xlabel(f"x in metres, to the east (fine lines: every {self.steps[1]:g} m)", fontsize=12)
        self.ax.set_ylabel("y in metres, to the north", fontsize=12)
        width, height = (side * DPI for side in self.figure.get_size_inches())
        left, top = EDGES[0] / width, 1 - 14 / height
        self.figure.text(left, top, self.roads.name, fontsize=16, weight="bold", va="top")
        self.figure.text(left, 14 / height, how_to, fontsize=11, va="bottom", linespacing=1.5)
        above = (60 + LINE * len(self.notes)) / height
        self.figure.legend(handles=_keys(), loc="lower left", bbox_to_anchor=(left, above), ncols=5,
                           frameon=False, fontsize=11, borderaxespad=0.0, borderpad=0.3)  # fmt: skip


def notes(roads: RoadNetwork) -> list[str]:
    """What to know of a map that was moved, or of which something was left out."""
    x, y = roads.offset
    moved_by = f"The map was moved to the origin: its own coordinates are these plus ({x:.0f}, {y:.0f})."
    left_out = f"Left out or changed: {', '.join(roads.dropped)}."
    return [moved_by] * any(roads.offset) + [left_out] * bool(roads.dropped)


def _keys() -> list[Any]:
    """What the marks mean, for a legend."""
    from matplotlib.lines import Line2D

    return [
        Line2D([], [], color=ROAD, lw=8, marker=">", mfc=ARROW, mec="none", ms=8, label="lane and its direction"),
        Line2D([], [], color=JUNCTION, lw=8, label="junction"),
        Line2D([], [], color=POST, lw=7, marker=".", mfc=LAMPS[0], mec="none", ms=7, label="traffic light"),
        Line2D([], [], color=STOP, lw=2.2, label="stop line"),
        Line2D([], [], ls="", marker="o", ms=12, mfc="white", mec=SIGN, mew=1.8, label="speed sign, km/h"),
    ]


def _outline(lane: Lane) -> Points:
    """A lane's edges as one polygon (N, 2)."""
    headings = np.append(lane.line.headings, lane.line.headings[-1])
    aside = np.stack((-np.sin(headings), np.cos(headings)), axis=1) * lane.width / 2
    return np.concatenate((lane.line.points + aside, (lane.line.points - aside)[::-1]))


def write_plan(town: str, path: Path, width: int | None = None) -> tuple[int, int]:
    """Writes a town's map as a PNG; returns (width, height) in pixels.

    Raises ValueError, FileNotFoundError or OSError for an unknown town, a name that is no .png, a place that cannot be
    written to.
    """
    require_writable_file(path, "--plan", ".png")
    width = USUAL_WIDTH if width is None else width
    require_within("--width", width, LEAST_WIDTH, 4 * MOST_PIXELS, USUAL_WIDTH)
    roads = load_roads(town)
    start, goal = example_places(roads)
    places = f"--from {start.x:.0f},{start.y:.0f} --to {goal.x:.0f},{goal.y:.0f}"
    figure = TownPlan(roads, width).draw(
        f"Drive between two places, for example: caldrive drive --town {town} {places}\n"
        "A place takes the nearest lane; X,Y,HEADING asks for another one (degrees from the east, counter-clockwise)."
    )
    write_figure(path, figure, DPI)
    with Picture.open(path) as picture:
        return picture.size
