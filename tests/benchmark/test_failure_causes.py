"""How a missed goal began, on hand-made traces."""

from __future__ import annotations

from typing import Any

from caldrive.benchmark.failure_causes import cause, common_places
from tests.benchmark.traces import after, trace


def test_a_car_that_leaves_its_lane_says_what_it_did_not_see() -> None:
    found = cause(
        trace(
            true_center_distance=after(200, 1.5, before=0.4), predicted_center_distance=0.1, command="left",
            true_relative_angle=0.14,
        )
    )  # fmt: skip
    assert (found.what, found.x, found.y, found.command) == ("left its lane", 100.0, 0.0, "left")
    assert found.seen == "relative angle off by 0.14 rad, centre distance off by 0.35 m"
    assert str(found).startswith("left its lane at (100, 0), left: relative angle")


def test_a_car_that_stands_for_nothing_says_what_it_saw() -> None:
    still: dict[str, Any] = {"speed": after(300, 0.0, before=5.0), "predicted_hazard_stop": after(300, 0.7)}
    found = cause(trace(state=after(300, "hazard stop", before="cruising"), **still))
    assert (found.what, found.x) == ("stood before no hazard", 150.0)
    assert found.seen == "hazard stop seen with 0.70"
    red = cause(trace(state=after(300, "red light", before="cruising"), speed=after(300, 0.0, before=5.0)))
    assert red.what == "stood at no red light"


def test_a_stop_that_is_right_or_short_is_no_cause() -> None:
    stop: dict[str, Any] = {"state": after(300, "hazard stop", before="cruising"), "speed": after(300, 0.0, before=5.0)}
    assert cause(trace(true_hazard_stop=after(300, 1.0), **stop)).what == "was too slow"
    short = [5.0] * 300 + [0.0] * 90 + [5.0] * 210
    assert cause(trace(state="hazard stop", speed=short)).seen == "stood for 15 % of the time"


def test_a_stop_that_flickers_is_one_and_short_ones_are_none() -> None:
    flickers = [5.0] * 300 + ([0.0] * 30 + [1.0] * 10) * 5 + [5.0] * 100
    assert cause(trace(state="hazard stop", speed=flickers)).x == 150.0
    lags = [5.0] * 100 + ([0.0] * 20 + [5.0] * 60) * 6 + [5.0] * 20
    assert cause(trace(state="hazard stop", speed=lags)).what == "was too slow"


def test_a_car_that_comes_back_to_its_lane_at_once_is_none_that_left_it() -> None:
    wide = [0.0] * 200 + [1.5] * 25 + [0.0] * 375
    assert cause(trace(true_center_distance=wide)).what == "was too slow"
    stop: dict[str, Any] = {"state": after(300, "hazard stop", before="cruising"), "speed": after(300, 0.0, before=5.0)}
    assert cause(trace(true_center_distance=wide, **stop)).what == "stood before no hazard"


def test_what_came_first_counts() -> None:
    stop: dict[str, Any] = {"state": after(300, "hazard stop", before="cruising"), "speed": after(300, 0.0, before=5.0)}
    assert cause(trace(true_center_distance=after(250, 2.0), **stop)).what == "left its lane"
    assert cause(trace(true_center_distance=after(350, 2.0), **stop)).what == "stood before no hazard"


def test_places_that_failures_share_come_first() -> None:
    left = [cause(trace(true_center_distance=after(at, 1.5))) for at in (200, 203, 400)]
    assert common_places(left) == [
        (("left its lane", 100, 0, "straight"), 2),
        (("left its lane", 200, 0, "straight"), 1),
    ]
