"""Draws docs/frames.png from the areas, the car and the lanes of the code: python scripts/make_frames.py"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Circle, FancyArrowPatch, FancyBboxPatch, Polygon, Rectangle
from matplotlib.transforms import Affine2D, Transform

from caldrive.datatypes import CameraConfig, Pose
from caldrive.geometry import Polyline, moved
from caldrive.world.roads.network import POST_BESIDE_LANE
from caldrive.world.roads.plans import LANE_WIDTH
from caldrive.world.traffic.ego import VehicleConfig
from caldrive.world.truth.labels import A1, A2, A3, Area

CAR, CAMERA = VehicleConfig(), CameraConfig()
BUMPER = CAR.length / 2 - CAR.front_axle
INK, SOFT, PAPER = "#1f2933", "#6b7785", "#ffffff"
ASPHALT, KERB, PAINT = "#e3e6ea", "#f3f1ec", "#ffffff"
AMBER, RED, BLUE, GREEN, VIOLET = "#c77700", "#c62839", "#1f6fb2", "#1d8348", "#7d3c98"
BREAK, GAP = 23.2, 0.7  # where A3 is cut, and how wide the cut is drawn
CUT = A3.far - BREAK - GAP - 2.6  # metres left out
HALF = LANE_WIDTH / 2


def arrow(
    axes: Axes, start: tuple[float, float], end: tuple[float, float], color: str, style: str = "-|>", width: float = 1.6
) -> None:
    axes.add_patch(
        FancyArrowPatch(
            start, end, arrowstyle=style, mutation_scale=11, color=color, lw=width, shrinkA=0, shrinkB=0, zorder=8
        )
    )


def note(axes: Axes, x: float, y: float, text: str, color: str = INK, size: float = 9.5, **more: Any) -> None:
    usual: dict[str, Any] = {"ha": "left", "va": "center", "zorder": 9, "linespacing": 1.35}
    axes.text(x, y, text, color=color, fontsize=size, **(usual | more))


def car(
    axes: Axes, pose: Pose, color: str, wheel: float = 0.0, length: float = CAR.length, width: float = CAR.width
) -> None:
    """A car from above at the pose of its centre; wheel: angle of the front wheels, rad."""
    place: Transform = Affine2D().rotate(pose.heading).translate(pose.x, pose.y) + axes.transData
    a, b = length / 2, width / 2
    for x, angle in ((-CAR.front_axle, 0.0), (CAR.front_axle, wheel)):
        for y in (-b + 0.12, b - 0.12):
            turned = Affine2D().rotate(angle).translate(x, y) + place
            axes.add_patch(Rectangle((-0.34, -0.13), 0.68, 0.26, color="#2b2f36", zorder=4, transform=turned))
    inner, style = (length - 0.9, width - 0.9), "round,pad=0.45,rounding_size=0.5"
    look: dict[str, Any] = {"fc": color, "ec": INK, "lw": 1.1, "alpha": 0.93}
    body = FancyBboxPatch((-a + 0.45, -b + 0.45), *inner, boxstyle=style, zorder=5, transform=place, **look)
    axes.add_patch(body)
    for corners in (
        [(0.75, 0.62), (0.25, 0.58), (0.25, -0.58), (0.75, -0.62)],
        [(-1.6, 0.55), (-1.25, 0.55), (-1.25, -0.55), (-1.6, -0.55)],
    ):
        axes.add_patch(Polygon(corners, fc="#dfe9f3", ec=INK, lw=0.6, zorder=6, transform=place))


def area(axes: Axes, one: Area, color: str, z: float, until: float | None = None) -> None:
    far = one.far if until is None else until
    box = (one.near, one.right), far - one.near, one.left - one.right
    axes.add_patch(Rectangle(*box, fc=color, alpha=0.15, lw=0, zorder=z))
    edge = [(far, one.left), (one.near, one.left), (one.near, one.right), (far, one.right)]
    axes.plot(*zip(*(edge if until else [*edge, edge[0]]), strict=True), color=color, lw=1.7, zorder=z + 0.1)


def street(axes: Axes, first: float, last: float) -> None:
    """The own lane, the opposite one on its left, the sidewalk on its right."""
    axes.add_patch(Rectangle((first, -HALF), last - first, 2 * LANE_WIDTH, color=ASPHALT, lw=0, zorder=0))
    axes.add_patch(Rectangle((first, -HALF - 4.6), last - first, 4.6, color=KERB, lw=0, zorder=0))
    axes.plot([first, last], [-HALF] * 2, color="#b9b3a6", lw=2.2, zorder=0.5)
    axes.plot([first, last], [HALF] * 2, color=PAINT, lw=2.4, dashes=(7, 5), zorder=0.5)
    axes.plot([first, last], [0, 0], color=BLUE, lw=1.3, dashes=(5, 3), zorder=3)


def furniture(axes: Axes) -> None:
    """A light and a sign where posts stand, and a person in the way."""
    y = -HALF - POST_BESIDE_LANE
    axes.add_patch(
        FancyBboxPatch((9.1, y - 0.28), 1.5, 0.56, boxstyle="round,pad=0.08", fc="#2b2f36", ec=INK, zorder=6)
    )
    for x, color in ((9.35, "#3b4a3f"), (9.85, "#4d4632"), (10.35, "#ff4d4d")):
        axes.add_patch(Circle((x, y), 0.19, color=color, zorder=7))
    axes.add_patch(Circle((12.4, y), 0.62, fc=PAPER, ec=RED, lw=3.4, zorder=6))
    note(axes, 12.4, y - 0.02, "30", size=9, ha="center", weight="bold")
    axes.add_patch(Circle((6.2, 1.35), 0.3, fc="#e8b98a", ec=INK, lw=1, zorder=6))


def cut_edges(axes: Axes) -> None:
    """The break in A3: a white band with wavy edges."""
    y = np.linspace(-HALF - 4.7, 2 * LANE_WIDTH - HALF + 0.1, 120)
    left, right = BREAK + 0.18 * np.sin(2.6 * y), BREAK + GAP + 0.18 * np.sin(2.6 * y)
    axes.fill_betweenx(y, left, right, color=PAPER, zorder=9.5, lw=0)
    for x in (left, right):
        axes.plot(x, y, color=SOFT, lw=0.9, zorder=9.6)


def scales(axes: Axes) -> None:
    """Forward and left in metres, with ticks at the borders of the areas."""
    y = -HALF - 4.75
    for x, shown in (
        (0.0, "0"),
        (A1.near, f"{A1.near:g}"),
        (A2.far, f"{A2.far:g}"),
        (A1.far, f"{A1.far:g}"),
        (A3.far - CUT, f"{A3.far:g}"),
    ):
        axes.plot([x, x], [y, y - 0.22], color=INK, lw=1, zorder=9)
        side = {A1.near: "right", A2.far: "left"}.get(x, "center")
        note(axes, x + {"right": 0.12, "left": -0.12, "center": 0}[side], y - 0.6, shown, ha=side)
    axes.plot([-4.2, BREAK - 0.15], [y, y], color=INK, lw=1)
    axes.plot([BREAK + GAP + 0.1, A3.far - CUT + 1.0], [y, y], color=INK, lw=1)
    note(axes, 18.6, y - 0.62, "x forward, m", SOFT, ha="center")
    x = -4.2
    for value in (A1.right, A2.right, A1.left, A2.left):
        axes.plot([x, x - 0.22], [value, value], color=INK, lw=1)
        note(axes, x - 0.4, value, f"{value:g}".replace("-", "−"), ha="right")
    axes.plot([x, x - 0.22], [0, 0], color=INK, lw=1)
    note(axes, x - 0.4, 0, "0", ha="right")
    axes.plot([x, x], [y, 2 * LANE_WIDTH - HALF], color=INK, lw=1)
    note(axes, x - 0.5, 4.4, "y left, m", SOFT, rotation=90, ha="center")


def draw_areas(axes: Axes) -> None:
    street(axes, -4.2, A3.far - CUT + 1.0)
    area(axes, A3, BLUE, 1.0, until=A3.far - CUT)
    axes.plot([A3.far - CUT] * 2, [A3.right, A3.left], color=BLUE, lw=1.7, zorder=1.1)
    area(axes, A2, RED, 1.3)
    area(axes, A1, AMBER, 1.6)
    furniture(axes)
    car(axes, Pose(-CAR.front_axle, 0, 0), "#8fb8de")
    leader = 19.4
    car(axes, Pose(leader, 0, 0), "#c9ced6")
    arrow(axes, (BUMPER, 0.5), (leader - CAR.length / 2, 0.5), BLUE, "<|-|>", 1.4)
    note(axes, 12.9, 0.98, "vehicle_distance: bumper to bumper", BLUE, ha="center", size=9)
    axes.plot([0, 0], [-1.25, 1.25], color=INK, lw=2.6, zorder=7)
    arrow(axes, (0, 0), (2.9, 0), INK, width=2.2)
    arrow(axes, (0, 0), (0, 3.0), INK, width=2.2)
    axes.add_patch(Circle((0, 0), 0.14, color=INK, zorder=9))
    note(axes, 2.9, -0.42, "x", weight="bold", size=12)
    note(axes, 0.25, 2.85, "y", weight="bold", size=12)
    axes.add_patch(Circle((-CAR.front_axle, 0), 0.13, fc=PAPER, ec=INK, lw=1.4, zorder=9))
    axes.plot([-CAR.front_axle, -2.2], [0, -2.5], color=SOFT, lw=0.8, zorder=8)
    note(
        axes,
        -4.0,
        -3.1,
        "pose: the centre,\n" + f"{CAR.front_axle:g} m behind\nthe front axle",
        SOFT,
        va="center",
        size=9,
    )
    axes.plot([0, -1.2], [1.1, 2.75], color=SOFT, lw=0.8, zorder=8)
    note(axes, -0.7, 3.45, "frame of the areas:\nmiddle of the\nfront axle", ha="right", size=9)
    note(axes, 3.7, 3.25, f"A2 hazard_stop\n{A2.near:g} to {A2.far:g} m ahead, {A2.left:g} m to each side", RED)
    note(
        axes,
        14.4,
        -4.0,
        f"A1 red_light, speed_sign\n{A1.near:g} to {A1.far:g} m ahead,\n{-A1.left:g} to {-A1.right:g} m to the right",
        AMBER,
    )
    note(axes, 13.4, 3.25, f"A3 vehicle_distance\n{A3.near:g} to {A3.far:g} m ahead, {A3.left:g} m to each side", BLUE)
    note(axes, 21.9, 5.2, "opposite lane", SOFT, ha="right", size=9)
    note(axes, 21.9, -5.9, "sidewalk", SOFT, ha="right", size=9)
    cut_edges(axes)
    scales(axes)
    axes.set(xlim=(-6.0, A3.far - CUT + 1.1), ylim=(-8.1, 6.15))


def bend(radius: float, before: float, after: float) -> Polyline:
    """A lane that goes straight and then turns left."""
    angles = np.linspace(0, after / radius, 60)
    arc = np.stack((radius * np.sin(angles), radius * (1 - np.cos(angles))), axis=1)
    return Polyline(np.concatenate(([(-before, 0.0)], arc)))


def angle(axes: Axes, at: Pose, radius: float, first: float, last: float, color: str) -> None:
    """An arc with an arrowhead from one heading to a larger one, rad."""
    axes.add_patch(
        Arc(
            (at.x, at.y),
            2 * radius,
            2 * radius,
            theta1=math.degrees(first),
            theta2=math.degrees(last),
            color=color,
            lw=2.0,
            zorder=8,
        )
    )
    tip = Pose(at.x + radius * math.cos(last), at.y + radius * math.sin(last), last)
    foot = moved(Pose(tip.x, tip.y, last + math.pi / 2), forward=-0.05)
    arrow(axes, (foot.x, foot.y), (tip.x, tip.y), color)


def draw_signs(axes: Axes) -> None:
    lane = bend(26.0, 8.0, 18.0)
    sides = [[moved(lane.pose_at(s), left=side) for s in np.linspace(0, lane.length, 80)] for side in (HALF, -HALF)]
    styles: tuple[dict[str, Any], ...] = ({"dashes": (7, 5), "color": "#b7bec7"}, {"color": "#b9b3a6"})
    for side, style in zip(sides, styles, strict=True):
        axes.plot([p.x for p in side], [p.y for p in side], lw=2.2, zorder=0.5, **style)
    axes.add_patch(Polygon([(p.x, p.y) for p in (*sides[0], *reversed(sides[1]))], color=ASPHALT, lw=0, zorder=0))
    axes.plot(*lane.points.T, color=BLUE, lw=1.5, dashes=(5, 3), zorder=3)
    nearest = lane.pose_at(12.0)
    axle = moved(nearest, left=-1.45, turn=-0.52)
    center = moved(axle, forward=-CAR.front_axle)
    car(axes, center, "#8fb8de", wheel=0.5)
    ahead, tangent = moved(axle, forward=5.6), moved(Pose(axle.x, axle.y, nearest.heading), forward=5.6)
    arrow(axes, (axle.x, axle.y), (ahead.x, ahead.y), INK, width=1.8)
    axes.plot([axle.x, tangent.x], [axle.y, tangent.y], color=BLUE, lw=1.4, dashes=(4, 2.5), zorder=7)
    angle(axes, axle, 4.6, axle.heading, nearest.heading, GREEN)
    arrow(axes, (axle.x, axle.y), (nearest.x, nearest.y), RED, width=2.2)
    axes.add_patch(Circle((axle.x, axle.y), 0.14, color=INK, zorder=9))
    axes.add_patch(Circle((nearest.x, nearest.y), 0.12, color=RED, zorder=9))
    note(
        axes,
        nearest.x - 0.1,
        nearest.y + 0.55,
        "center_distance > 0:\nthe line lies to the left",
        RED,
        ha="right",
        va="bottom",
    )
    middle = moved(Pose(axle.x, axle.y, (axle.heading + nearest.heading) / 2), forward=4.9)
    note(axes, middle.x + 0.1, middle.y, "relative_angle > 0:\nthe route runs further to the left", GREEN)
    wheel = moved(center, forward=CAR.front_axle, left=-CAR.width / 2 + 0.12, turn=0.5)
    rolled = moved(wheel, forward=1.7)
    arrow(axes, (wheel.x, wheel.y), (rolled.x, rolled.y), AMBER, width=2.2)
    note(axes, wheel.x - 1.2, wheel.y - 1.1, "steer > 0: wheels to the left", AMBER)
    note(axes, ahead.x + 0.15, ahead.y - 0.05, "heading of the car", SOFT, size=9)
    note(axes, tangent.x + 0.2, tangent.y - 0.12, "direction of the route", SOFT, size=9)
    axes.add_patch(Circle((center.x, center.y), 0.13, fc=PAPER, ec=INK, lw=1.4, zorder=9))
    note(
        axes,
        -7.9,
        4.6,
        "Left is positive everywhere. Here all three are, and\na wheel to the left brings the two errors back to 0.",
    )
    draw_compass(axes, Pose(15.0, -2.4, 0.0))
    axes.set(xlim=(-8.4, 19.4), ylim=(-4.2, 5.9))


def draw_compass(axes: Axes, at: Pose) -> None:
    """The world's axes and the sense of heading and yaw."""
    arrow(axes, (at.x, at.y), (at.x + 2.6, at.y), INK)
    arrow(axes, (at.x, at.y), (at.x, at.y + 2.6), INK)
    note(axes, at.x + 2.65, at.y - 0.45, "x east", ha="right", va="center", size=9)
    note(axes, at.x - 0.2, at.y + 2.5, "y north", ha="right", size=9)
    arrow(axes, (at.x, at.y), (at.x + 2.3 * math.cos(0.8), at.y + 2.3 * math.sin(0.8)), SOFT, width=1.3)
    angle(axes, at, 1.5, 0.0, 0.8, VIOLET)
    note(axes, at.x + 1.65, at.y + 0.62, "heading, yaw", VIOLET, size=9)
    note(axes, at.x - 0.2, at.y - 1.1, "counter-clockwise, rad", VIOLET, size=9)


def main() -> None:
    mpl.rcParams["font.family"] = "DejaVu Sans"
    figure = Figure(figsize=(13.0, 11.5), dpi=100, facecolor=PAPER)
    grid = figure.add_gridspec(
        2, 1, height_ratios=(14.25, 10.1), hspace=0.07, left=0.01, right=0.99, top=0.965, bottom=0.01
    )
    titles = "What the ego looks at (supplement 2.1)", "What the signs mean"
    for i, (draw, title) in enumerate(zip((draw_areas, draw_signs), titles, strict=True)):
        axes = figure.add_subplot(grid[i])
        draw(axes)
        axes.set_aspect("equal")
        axes.axis("off")
        axes.set_title(title, loc="left", fontsize=13, color=INK, weight="bold", x=0.02, pad=4)
    figure.savefig(Path(__file__).parents[1] / "docs" / "frames.png")


if __name__ == "__main__":
    main()
