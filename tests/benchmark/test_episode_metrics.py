"""What an agent was off by, on steps whose answers are known."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from caldrive.agents.cal import UNKNOWN
from caldrive.benchmark.episode_metrics import EpisodeMetrics, red_lights_obeyed
from caldrive.control.longitudinal import DriveState
from caldrive.datatypes import Affordances, Control, Decision, Observation, Pose, Step, Truth, VehicleState
from caldrive.files import json_line
from caldrive.results import Infraction, InfractionKind
from tests.perception.data import column_image


def step(time: float, seen: Affordances, true: Affordances, opposite: float = 0.0) -> Step:
    observation = Observation(time, column_image(0.0), 5.0, "straight")  # type: ignore[arg-type]
    truth = Truth(time, VehicleState(Pose(5 * time, 0, 0), 5.0), true, opposite_share=opposite)
    return Step(observation, truth, Control(), Decision(Control(), seen, DriveState.CRUISING, 30.0, 20.0))


def test_errors_are_means_over_the_episode_and_over_the_seconds_before_an_infraction() -> None:
    true, episode = Affordances(), EpisodeMetrics()
    for k in range(100):
        wrong = replace(true, relative_angle=0.3, hazard_stop=0.9) if k >= 75 else true
        episode.add(step(k / 10, wrong, true))
    metrics = episode.metrics([Infraction(InfractionKind.SIDEWALK, 9.9, 0, 0)])
    assert metrics["error/relative_angle"] == pytest.approx(0.3 * 0.25)
    assert metrics["error/hazard_stop"] == pytest.approx(0.25)
    assert metrics["before/0/relative_angle"] == pytest.approx(0.3 * 25 / 30, abs=0.011)
    assert metrics["before/0/red_light"] == 0


def test_time_off_the_lane_counts() -> None:
    episode, true = EpisodeMetrics(), Affordances()
    for k in range(60):
        episode.add(step(k / 10, true, true, opposite=0.5 if k < 15 else 0.1))
    assert episode.metrics([])["off_lane"] == pytest.approx(0.25)


def test_all_figures_are_jsons() -> None:
    episode, red = EpisodeMetrics(), Affordances(red_light=1.0)
    for k in range(20):
        seen = step(k / 10, red, red)
        episode.add(replace(seen, truth=replace(seen.truth, ego=VehicleState(Pose(0, 0, 0), 0.0))))
    metrics = episode.metrics([Infraction(InfractionKind.SIDEWALK, 1.0, 0, 0)])
    assert json.loads(json_line(metrics)) == metrics
    assert metrics["reds_obeyed"] == 1


APPROACH = [8.0, 6.0, 4.0, 2.0, 0.0, 0.0, 0.0, 0.0]  # m/s, to a stand
AWAY = [2.0, 4.0, 6.0, 8.0, 8.0, 8.0, 8.0, 8.0]


@pytest.mark.parametrize(
    ("red", "speed", "run", "obeyed"),
    [
        ([1] * 8 + [0] * 8, APPROACH + AWAY, [], 1),
        ([1, 1, 0, 1, 1, 0, 1, 1] + [0] * 8, APPROACH + AWAY, [], 1),  # it flickered
        ([1, 1, 0, 0, 0, 0, 0, 0], AWAY, [], 0),  # passed on yellow
        ([1] * 8 + [0] * 8, APPROACH + AWAY, [5.0], 0),  # it stood, and then it went
        (([1] * 8 + [0] * 8) * 2, (APPROACH + AWAY) * 2, [], 2),
        (([1] * 8 + [0] * 8) * 2, (APPROACH + AWAY) * 2, [13.0], 1),
        ([0] * 8, [0.0] * 8, [], 0),
    ],
)
def test_a_red_light_is_obeyed_where_the_car_stood_before_it_and_did_not_run_it(
    red: list[int], speed: list[float], run: list[float], obeyed: int
) -> None:
    time = 0.5 * np.arange(len(red), dtype=np.float64)
    assert red_lights_obeyed(time, np.array(red, np.float64), np.array(speed, np.float64), run) == obeyed


def test_a_blind_frame_is_no_right_answer() -> None:
    episode, true = EpisodeMetrics(), Affordances(hazard_stop=1.0)
    for k in range(10):
        episode.add(step(k / 10, UNKNOWN if k < 5 else replace(true, hazard_stop=0.0), true))
    metrics = episode.metrics([])
    assert (metrics["error/hazard_stop"], metrics["error/relative_angle"]) == (1.0, 0.0)


def test_an_affordance_that_is_never_known_has_no_error_and_the_others_do() -> None:
    episode, true = EpisodeMetrics(), Affordances()
    for k in range(10):
        episode.add(step(k / 10, replace(UNKNOWN, center_distance=0.5 if k % 2 else 0.1), true))
    metrics = episode.metrics([])
    assert metrics["error/center_distance"] == pytest.approx(0.3)
    assert {name for name in metrics if name.startswith("error/")} == {"error/center_distance", "error/speed_sign"}
