"""How a missed goal began, on hand-made traces."""

from __future__ import annotations

from caldrive.benchmark.failure_causes import common_places, failure_cause
from tests.benchmark.traces import after, trace


def test_a_car_that_leaves_its_lane_says_what_it_did_not_see() -> None:
    cause = failure_cause(
        trace(
            true_center_distance=after(200, 1.5, before=0.4), predicted_center_distance=0.1, command="left",
            true_relative_angle=0.14,
        )
    )  # fmt: skip
    assert (cause.event, cause.x, cause.y, cause.command) == ("left its lane", 100.0, 0.0, "left")
    assert cause.seen == "relative angle off by 0.14 rad, center distance off by 0.35 m"
    assert str(cause).startswith("left its lane at (100, 0), left: relative angle")


def test_a_car_that_stands_for_nothing_says_what_it_saw() -> None:
    still = {"speed": after(300, 0.0, before=5.0), "predicted_hazard_stop": after(300, 0.7)}
    cause = failure_cause(trace(state=after(300, "hazard stop", before="cruising"), **still))
    assert (cause.event, cause.x) == ("stopped without a hazard", 150.0)
    assert cause.seen == "hazard stop seen with 0.70"
    red = failure_cause(trace(state=after(300, "red light", before="cruising"), speed=after(300, 0.0, before=5.0)))
    assert red.event == "stopped without a red light"


def test_steps_in_which_the_truth_is_not_known_do_not_count() -> None:
    assert failure_cause(trace(true_center_distance=after(200, 1.5, before=None))).x == 100.0
    assert failure_cause(trace(true_center_distance=None)).event == "was too slow"


def test_an_agent_without_affordances_left_its_lane_or_stood_all_the_same() -> None:
    unseen = dict.fromkeys(("predicted_center_distance", "predicted_relative_angle", "predicted_hazard_stop"))
    cause = failure_cause(trace(true_center_distance=after(200, 1.5), **unseen))
    assert str(cause) == "left its lane at (100, 0), straight: the agent gives no affordances"
    stop = {"state": after(300, "hazard stop", before="waiting"), "speed": after(300, 0.0, before=5.0)}
    assert failure_cause(trace(**stop, **unseen)).seen == cause.seen
    assert failure_cause(trace(**stop | {"state": None}, **unseen)).event == "was too slow"


def test_a_stop_that_is_right_or_short_is_no_cause() -> None:
    stop = {"state": after(300, "hazard stop", before="cruising"), "speed": after(300, 0.0, before=5.0)}
    assert failure_cause(trace(true_hazard_stop=after(300, 1.0), **stop)).event == "was too slow"
    short = [5.0] * 300 + [0.0] * 90 + [5.0] * 210
    assert failure_cause(trace(state="hazard stop", speed=short)).seen == "stood for 15 % of the time"


def test_a_stop_that_flickers_is_one_and_short_ones_are_none() -> None:
    flickers = [5.0] * 300 + ([0.0] * 30 + [1.0] * 10) * 5 + [5.0] * 100
    assert failure_cause(trace(state="hazard stop", speed=flickers)).x == 150.0
    lags = [5.0] * 100 + ([0.0] * 20 + [5.0] * 60) * 6 + [5.0] * 20
    assert failure_cause(trace(state="hazard stop", speed=lags)).event == "was too slow"


def test_a_car_that_comes_back_to_its_lane_at_once_is_none_that_left_it() -> None:
    wide = [0.0] * 200 + [1.5] * 25 + [0.0] * 375
    assert failure_cause(trace(true_center_distance=wide)).event == "was too slow"
    stop = {"state": after(300, "hazard stop", before="cruising"), "speed": after(300, 0.0, before=5.0)}
    assert failure_cause(trace(true_center_distance=wide, **stop)).event == "stopped without a hazard"


def test_what_came_first_counts() -> None:
    stop = {"state": after(300, "hazard stop", before="cruising"), "speed": after(300, 0.0, before=5.0)}
    assert failure_cause(trace(true_center_distance=after(250, 2.0), **stop)).event == "left its lane"
    assert failure_cause(trace(true_center_distance=after(350, 2.0), **stop)).event == "stopped without a hazard"


def test_places_that_failures_share_come_first() -> None:
    causes = [failure_cause(trace(true_center_distance=after(at, 1.5))) for at in (200, 203, 400)]
    assert common_places(causes) == [
        (("left its lane", 100, 0, "straight"), 2),
        (("left its lane", 200, 0, "straight"), 1),
    ]
