"""A town's plan: every place of the town is where its coordinates say, and can be read off."""

from __future__ import annotations

import io
import math
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from PIL import Image as Picture

from caldrive.datatypes import Image
from caldrive.visualization.town_plan import (
    JUNCTION,
    LEAST_WIDTH,
    ROAD,
    USUAL_WIDTH,
    TownPlan,
    example_places,
    grid_steps,
    map_bounds,
    notes,
    write_plan,
)
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.roads.route import plan_route
from caldrive.world.roads.towns import load_roads
from tests.maps import sign_at, straight, write_map


def drawn(plan: TownPlan) -> Image:
    content = io.BytesIO()
    plan.draw("").savefig(content, format="png")
    return np.asarray(Picture.open(content).convert("RGB"))


def color_at(plan: TownPlan, picture: Image, x: float, y: float) -> tuple[int, ...]:
    """The colour of the picture where the figures on its axes say (x, y) is."""
    column, row_from_below = plan.ax.transData.transform((x, y))
    return tuple(picture[picture.shape[0] - 1 - round(row_from_below), round(column)].tolist())


def rgb(color: str) -> tuple[int, ...]:
    return tuple(round(255 * share) for share in to_rgb(color))


@pytest.mark.parametrize(
    ("span", "steps"), [(430, (50, 10)), (220, (20, 5)), (90, (10, 2)), (14_000, (2000, 500)), (10, (1, 0.2))]
)
def test_lines_of_the_grid_lie_at_round_figures(span: float, steps: tuple[float, float]) -> None:
    assert grid_steps(span) == pytest.approx(steps)


def test_roads_junctions_and_free_ground_are_where_their_coordinates_say(town01: RoadNetwork) -> None:
    plan = TownPlan(town01)
    picture = drawn(plan)
    assert picture.shape[1] == USUAL_WIDTH
    assert color_at(plan, picture, 131.3, 187) == rgb(ROAD)
    assert color_at(plan, picture, 128.7, 187) == rgb(ROAD)
    assert color_at(plan, picture, 131, 143) == rgb(JUNCTION)
    assert color_at(plan, picture, 163, 57) == (255, 255, 255)


def test_axes_are_figures_in_metres_on_all_sides_and_north_is_up(town01: RoadNetwork) -> None:
    plan = TownPlan(town01)
    drawn(plan)
    x0, y0, x1, y1 = map_bounds(town01)
    assert plan.ax.get_xlim() == pytest.approx((x0, x1))
    assert plan.ax.get_ylim() == pytest.approx((y0, y1))
    labels = [label.get_text() for label in plan.ax.get_yticklabels()]
    assert {"0", "50", "100", "300"} <= set(labels)
    across, up = (plan.ax.transData.transform(end) - plan.ax.transData.transform((0, 0)) for end in ((9, 0), (0, 9)))
    assert across[0] == pytest.approx(up[1], rel=0.01)  # a metre is as long to the north as to the east


def test_figures_below_zero_are_written_as_they_are_typed(town01: RoadNetwork) -> None:
    plan = TownPlan(town01)
    assert plan.ax.get_xlim()[0] < 0
    drawn(plan)
    assert plan.ax.yaxis.get_major_formatter()(-50.0, 0) == "-50"


def test_every_sign_and_every_light_is_drawn(town: RoadNetwork) -> None:
    plan = TownPlan(town)
    plan.draw("")
    limits = sorted(int(text.get_text()) for text in plan.ax.texts)
    assert limits == sorted(sign.limit for sign in town.signs)
    assert len(plan.ax.patches) == len(town.posts)


def test_arrows_point_where_the_lane_goes(town02: RoadNetwork) -> None:
    plan = TownPlan(town02)
    plan.draw("")
    arrows = max(plan.ax.collections, key=lambda collection: collection.get_zorder())
    for path in arrows.get_paths():
        tip, _, tail, *_ = np.asarray(path.vertices)
        middle = (tip + tail) / 2
        hits = [lane.line.project(*middle) for lane in town02.driveable]
        hit = min(hits, key=lambda hit: abs(hit.left))
        assert math.cos(math.atan2(*(tip - tail)[::-1]) - hit.heading) > 0.9


def test_the_example_can_be_driven(town: RoadNetwork) -> None:
    start, goal = example_places(town)
    assert plan_route(town, start, goal).length > 30


def test_a_map_of_one_flat_road_is_drawn_on_a_page_that_can_be_read(tmp_path: Path) -> None:
    path = write_map(tmp_path, signals=sign_at(50.0))
    roads = load_roads(str(path))
    x0, y0, x1, y1 = map_bounds(roads)
    assert 0.25 < (y1 - y0) / (x1 - x0) < 0.35
    width, height = write_plan(str(path), tmp_path / "plan.png", LEAST_WIDTH)
    assert width == LEAST_WIDTH
    assert height > 300


def test_a_road_that_is_thinner_than_a_pixel_shows(tmp_path: Path) -> None:
    long = '<geometry s="0" x="0" y="0" hdg="0.7853981633974483" length="20000"><line/></geometry>'
    path = write_map(tmp_path, geometry=long, length=20_000)
    plan = TownPlan(load_roads(str(path)))
    picture = drawn(plan)
    column, row = (round(float(value)) for value in plan.ax.transData.transform((200, 200)))
    around = picture[picture.shape[0] - row - 6 : picture.shape[0] - row + 6, column - 6 : column + 6]
    assert (around.min(axis=2) < 240).sum() > 12


def test_the_plan_says_what_was_left_out_and_where_the_map_lies(tmp_path: Path) -> None:
    path = write_map(tmp_path, straight(90_000, 0, 0, 100), signals=sign_at(400))
    assert notes(load_roads(str(path))) == [
        "The map was moved to the origin: its own coordinates are these plus (90000, 0).",
        "Left out or changed: signals beyond the end of their road (1).",
    ]
    assert notes(load_roads("town02")) == []
