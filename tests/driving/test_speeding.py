"""Speeding: what is too fast for how long, where a lower limit leaves time to brake."""

from __future__ import annotations

import pytest

from caldrive.datatypes import KMH, Affordances, Pose, Truth, VehicleState
from caldrive.driving.referee import Referee
from caldrive.driving.speeding import BRAKING, TOLERANCE, SpeedWatch
from caldrive.results import InfractionKind
from caldrive.scenarios import Scenario

SCENARIO = Scenario("town", 1, Pose(0, 0, 0), Pose(1000, 0, 0))


def drive(speeds: list[float], limits: list[float]) -> list[Truth]:
    """Frames at 10 Hz; speeds and limits in km/h."""
    return [
        Truth(0.1 * i, VehicleState(Pose(0, 0, 0), speed * KMH), Affordances(), speed_limit=limit)
        for i, (speed, limit) in enumerate(zip(speeds, limits, strict=True))
    ]


def watch(speeds: list[float], limits: list[float]) -> tuple[float, float]:
    """Share of the time that was too fast, and the worst excess in km/h."""
    speed = SpeedWatch()
    for truth in drive(speeds, limits):
        speed.is_too_fast(truth)
    return speed.share, speed.worst


def test_who_keeps_to_the_limit_is_not_too_fast() -> None:
    assert watch([30.0] * 50, [30.0] * 50) == (0.0, 0.0)
    share, worst = watch([30.0 + TOLERANCE - 0.1] * 50, [30.0] * 50)
    assert (share, worst) == (0.0, pytest.approx(TOLERANCE - 0.1))


def test_the_share_of_time_and_the_worst_excess_are_measured() -> None:
    assert watch([30.0] * 30 + [50.0] * 10, [30.0] * 40) == (0.25, pytest.approx(20.0))


def test_a_lower_sign_leaves_time_to_brake_and_no_more() -> None:
    steps = range(80)
    braking = [max(30.0, 60.0 - BRAKING / KMH * 0.1 * k) for k in steps]
    assert watch([60.0, *braking], [60.0] + [30.0] * 80)[0] == 0.0
    late = [max(30.0, 60.0 - BRAKING / KMH * 0.1 * max(0, k - 20)) for k in steps]
    assert watch([60.0, *late], [60.0] + [30.0] * 80)[0] > 0.2


def test_a_higher_sign_counts_at_once() -> None:
    assert watch([30.0, 60.0, 60.0], [30.0, 60.0, 60.0])[0] == 0.0


def test_a_stretch_of_speeding_is_one_infraction_where_signs_are_obeyed() -> None:
    frames = drive([30.0] * 10 + [60.0] * 100 + [30.0] * 30 + [60.0] * 5, [30.0] * 145)
    for signs, count in ((True, 2), (False, 0)):
        referee = Referee(SCENARIO, signs=signs)
        for truth in frames:
            referee.watch(truth)
        assert [i.kind for i in referee.infractions] == [InfractionKind.SPEEDING] * count
        assert referee.result().speeding == pytest.approx(105 / 145)
