"""Figures of driving on trajectories whose answers are known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from caldrive.driving.comfort import comfort, motion

DT = 0.1
TIME = np.arange(0, 20, DT)


def test_a_steady_drive_straight_on_is_perfectly_smooth() -> None:
    metrics = motion(np.full(200, 8.0), np.zeros(200), DT)
    assert metrics["jerk"] == pytest.approx(0, abs=1e-9)
    assert metrics["lateral_straight"] == pytest.approx(0, abs=1e-9)
    assert (metrics["turning"], metrics["comfortable"]) == (0.0, 1.0)


def test_even_acceleration_has_no_jerk() -> None:
    metrics = motion(1.5 * TIME, np.zeros(200), DT)
    assert metrics["jerk"] == pytest.approx(0, abs=1e-9)
    assert metrics["comfortable"] == 1.0


def test_a_swinging_speed_has_the_jerk_of_its_second_derivative() -> None:
    metrics = motion(10 + np.sin(0.5 * TIME), np.zeros(200), DT)
    assert metrics["jerk"] == pytest.approx(0.25 / math.sqrt(2), rel=0.05)


def test_a_steady_turn_counts_as_turning_without_lateral_jerk() -> None:
    metrics = motion(np.full(200, 5.0), 0.3 * TIME, DT)
    assert metrics["turning"] == pytest.approx(20.0)
    assert metrics["lateral_turn"] == pytest.approx(0, abs=1e-9)


def test_a_swinging_wheel_has_the_lateral_jerk_of_its_yaw_acceleration() -> None:
    heading = 0.2 * np.sin(TIME)  # yaw rate 0.2 cos, lateral jerk 5 m/s times -0.2 sin
    metrics = motion(np.full(200, 5.0), heading, DT)
    both = math.sqrt(
        (
            metrics["turning"] * metrics["lateral_turn"] ** 2
            + (20 - metrics["turning"]) * metrics["lateral_straight"] ** 2
        )
        / 20
    )
    assert both == pytest.approx(1.0 / math.sqrt(2), rel=0.06)


@pytest.mark.parametrize("speed", [6.0 * TIME, np.maximum(20 - 5.0 * TIME, 0)])
def test_hard_acceleration_and_braking_are_not_comfortable(speed: np.ndarray) -> None:
    assert motion(speed, np.zeros(200), DT)["comfortable"] < 0.9


def test_an_episode_of_a_moment_has_figures_too() -> None:
    assert motion(np.ones(2), np.zeros(2), DT)["jerk"] == 0


def test_an_episodes_figures_hold_its_median_distance_to_the_centre_line() -> None:
    times = [0.1 * i for i in range(50)]
    metrics = comfort(times, [t * t for t in times], [0.0] * 50, [-0.4, 0.1, 0.2])
    assert metrics["center_distance"] == pytest.approx(0.2)
    assert metrics["jerk"] == pytest.approx(2.0)
    assert comfort([], [], [], [])["center_distance"] == 0.0
