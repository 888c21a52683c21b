"""Which episodes are driven: a task's routes from one on, or the way between two places of one's own."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from caldrive.driving.choice import OWN_TASK, chosen_scenarios, parse_place
from caldrive.driving.settings import EpisodeSettings
from caldrive.driving.tasks import task_scenarios
from caldrive.world.roads.route import plan_route
from caldrive.world.roads.towns import load_roads
from tests.command_line import run_json

# In town01 cars drive to the north at x = 132 and to the south at x = 128.
SOUTH, NORTH = -math.pi / 2, math.pi / 2


def test_a_tasks_routes_are_chosen_from_one_on_and_begin_again() -> None:
    settings = EpisodeSettings(town="town02", task="one-turn", route=23, seed=3)
    of_task = task_scenarios("town02", "one-turn", 1, seed=3)
    assert chosen_scenarios(settings, 4) == [of_task[k] for k in (23, 24, 0, 1)]


def test_seconds_shorten_an_episode_and_never_lengthen_it() -> None:
    usual, short, long = (
        chosen_scenarios(EpisodeSettings(task="straight", seconds=seconds), 1)[0].time_limit
        for seconds in (None, 2.0, 9999.0)
    )
    assert short == 2.0
    assert long == usual > 2.0


def test_a_place_takes_the_middle_of_the_nearest_lane_and_its_heading() -> None:
    [scenario] = chosen_scenarios(EpisodeSettings(start="128.7,200", goal="127,160", cars=2, weather=6), 1)
    assert (scenario.start.x, scenario.start.y, scenario.start.heading) == pytest.approx((128, 200, SOUTH), abs=0.01)
    assert (scenario.goal.x, scenario.goal.y, scenario.goal.heading) == pytest.approx((128, 160, SOUTH), abs=0.01)
    assert (scenario.task, scenario.n_vehicles, scenario.n_pedestrians, scenario.weather) == (OWN_TASK, 2, 0, 6)
    length = plan_route(load_roads("town01"), scenario.start, scenario.goal).length
    assert length == pytest.approx(40, abs=0.1)
    assert scenario.time_limit == pytest.approx(length * 0.36)


def test_a_heading_chooses_the_lane_beside() -> None:
    [scenario] = chosen_scenarios(EpisodeSettings(start="129.5,200,90", goal="132,210"), 1)
    assert (scenario.start.x, scenario.start.heading) == pytest.approx((132, NORTH), abs=0.01)


def test_every_episode_between_ones_own_places_is_the_same() -> None:
    one, other = chosen_scenarios(EpisodeSettings(start="128,200", goal="128,150"), 2)
    assert one == other


def test_a_place_away_from_lanes_names_the_nearest_lane_as_it_is_typed() -> None:
    with pytest.raises(
        ValueError, match=r"found no lane of town01 at \(50.0, 50.0\).*nearest is -CA3_0 at \(2.0, 50.0\)"
    ):
        chosen_scenarios(EpisodeSettings(start="50,50", goal="128,150"), 1)
    with pytest.raises(ValueError, match=r"at \(132.0, 200.0\) with heading -90°.*DF0_0 at .* with heading 90°"):
        chosen_scenarios(EpisodeSettings(start="132,200,-90", goal="128,150"), 1)


@pytest.mark.parametrize("text", ["", "132", "here", "1,2,3,4", "1,b", "nan,2", "1,inf", "1;2"])
def test_a_text_that_is_no_place_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="type --to 130,45 or --to 130,45,90"):
        parse_place(text, "--to")


def test_a_place_is_two_numbers_and_perhaps_a_heading_in_degrees() -> None:
    assert parse_place("-2,4.5", "--to") == (-2.0, 4.5, None)
    assert parse_place(" 1, 2, 180", "--to") == (1.0, 2.0, pytest.approx(math.pi))


@pytest.mark.parametrize(
    ("settings", "found"),
    [
        (EpisodeSettings(start="128,200"), "found --from 128,200, wanted a start and a goal"),
        (EpisodeSettings(goal="128,200"), "found --to 128,200, wanted a start and a goal"),
        (EpisodeSettings(world="mine.py:World"), "found neither --from nor --to"),
    ],
)
def test_one_place_alone_is_refused(settings: EpisodeSettings, found: str) -> None:
    with pytest.raises(ValueError, match=f"{found}.*type --from X,Y --to X,Y"):
        chosen_scenarios(settings, 1)


def test_in_a_world_without_a_map_the_car_starts_towards_its_goal() -> None:
    settings = EpisodeSettings(world="mine.py:World", start="10,0", goal="10,100")
    [scenario] = chosen_scenarios(settings, 1)
    assert (scenario.start.x, scenario.start.heading) == pytest.approx((10, NORTH))
    assert scenario.time_limit == pytest.approx(100 / (5 / 3.6) + 20)


def test_ones_own_places_are_driven(tmp_path: Path) -> None:
    places = ("--from", "128,215", "--to", "128,175")
    [episode] = run_json("drive", "--agent", "oracle", *places, "--no-video", "--out", str(tmp_path))["episodes"]
    assert episode["outcome"] == "success"
    assert episode["scenario"]["task"] == OWN_TASK
    assert episode["distance"] == pytest.approx(40, abs=8)
    assert episode["infractions"] == []
