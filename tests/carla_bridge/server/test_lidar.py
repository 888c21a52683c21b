"""Rays and a lidar before a flat ground and a wall whose distances are known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from caldrive.carla_bridge.axes import Placement
from caldrive.carla_bridge.server.layouts import ActorDescription, AttributeValue
from caldrive.carla_bridge.server.lidar import Array, Rays, cast, lidar_settings, scan
from caldrive.carla_bridge.server.wire import Refusal
from caldrive.world.rendering.pinhole import PinholeCamera

WALL = 10.0  # m: where x is that, there is a wall
FAR = 1e4  # m
HALF_A_PIXEL = math.radians(0.2)


def depths(camera: PinholeCamera) -> Array:
    """A flat ground, and a wall at x = WALL."""
    view, (width, height) = camera.view(), camera.size
    columns, rows = np.meshgrid(np.arange(width), np.arange(height))
    ways = view.ahead.astype(float) + columns[..., None] * view.right + rows[..., None] * view.down
    with np.errstate(divide="ignore"):
        ground = np.where(ways[..., 2] < 0, -view.position[2] / ways[..., 2], FAR)
        wall = np.where(ways[..., 0] > 0, (WALL - view.position[0]) / ways[..., 0], FAR)
    return np.minimum(np.minimum(ground, wall), FAR)[..., None]


def rays(delta: float = 0.1) -> Rays:
    return Rays(delta, depths, np.random.default_rng(1))


def asked(**attributes: str) -> ActorDescription:
    rows = tuple(AttributeValue(name, 4, value) for name, value in attributes.items())
    return ActorDescription(1, "sensor.lidar.ray_cast", rows)


@pytest.mark.parametrize("heading", [0.0, 1.0, math.pi])
def test_rays_end_on_the_ground_and_on_the_wall(heading: float) -> None:
    azimuths, elevations = np.radians([180.0 - 57.0 * k for k in range(7)]), np.radians([-5.0, -20.0, 3.0] * 3)[:7]
    place = Placement(2.0, -3.0, 1.5, heading)
    ends = cast(place, azimuths, elevations, depths)
    c, s = math.cos(heading), math.sin(heading)
    x, z = 2.0 + c * ends[:, 0] - s * ends[:, 1], 1.5 + ends[:, 2]
    is_something = np.linalg.norm(ends, axis=1) < 100.0
    on_ground, on_wall = np.abs(z) < 1e-6, np.abs(x - WALL) < 1e-6
    assert (on_ground | on_wall)[is_something].all()
    assert is_something[elevations < 0].all()
    assert np.abs(np.arctan2(ends[:, 1], ends[:, 0]) - azimuths + math.pi).max() % math.tau == pytest.approx(
        math.pi, abs=HALF_A_PIXEL
    )
    assert np.arctan2(ends[:, 2], np.hypot(ends[:, 0], ends[:, 1])) == pytest.approx(elevations, abs=HALF_A_PIXEL)


def test_a_tilted_sensor_looks_where_it_is_tilted_to() -> None:
    nose_up = Placement(z=1.5, pitch=math.radians(20.0))
    ahead, behind = cast(nose_up, np.array([0.0, math.pi]), np.zeros(2), depths)
    assert ahead[0] == pytest.approx(WALL / math.cos(math.radians(20.0)), rel=0.01)
    assert np.linalg.norm(behind) == pytest.approx(1.5 / math.sin(math.radians(20.0)), rel=0.02)


def test_a_lidar_turns_to_the_right_and_counts_what_each_channel_finds() -> None:
    lidar = lidar_settings(asked(channels="4", points_per_second="4000", range="50", dropoff_general_rate="0.0"))
    place = Placement(z=2.0)
    quarter = scan(lidar, place, math.pi, rays(delta=0.025))  # from ahead
    assert quarter.counts.tolist()[1:] == [25, 25, 25]
    assert len(quarter.points) == quarter.counts.sum()
    lowest = quarter.points[-25:]
    angles = np.arctan2(lowest[:, 1], lowest[:, 0])
    assert angles[0] == pytest.approx(0.0, abs=HALF_A_PIXEL)
    assert (np.diff(angles) < 0).all()
    assert angles[-1] == pytest.approx(-math.pi / 2 * 24 / 25, abs=HALF_A_PIXEL)
    assert np.linalg.norm(lowest[:, :3], axis=1) == pytest.approx(4.0, rel=0.02)
    assert lowest[:, 3] == pytest.approx(math.exp(-0.004 * 4.0), rel=1e-3)


@pytest.mark.parametrize(("general", "dark", "kept"), [("0.45", "0.0", 0.55), ("0.0", "0.4", 0.76), ("1.0", "0", 0.0)])
def test_points_are_lost_by_chance_and_where_it_is_dark(general: str, dark: str, kept: float) -> None:
    lidar = lidar_settings(asked(
        channels="1", upper_fov="-30", points_per_second="40000", dropoff_general_rate=general,
        dropoff_intensity_limit="0.8", dropoff_zero_intensity=dark,
        atmosphere_attenuation_rate=str(-math.log(0.32) / 4.0),  # at 4 m 0.6 of the limit is missing
    ))  # fmt: skip
    found = scan(lidar, Placement(z=2.0), 0.0, rays())
    assert found.counts[0] / 4000 == pytest.approx(kept, abs=0.03)


def test_without_a_limit_of_intensity_no_point_is_lost_in_the_dark() -> None:
    lidar = lidar_settings(
        asked(channels="1", upper_fov="-30", dropoff_general_rate="0", dropoff_intensity_limit="0.0")
    )
    assert scan(lidar, Placement(z=2.0), 0.0, rays()).counts.sum() == 5600


def test_noise_moves_points_along_their_rays() -> None:
    usual = {"channels": "1", "upper_fov": "-30", "dropoff_general_rate": "0", "dropoff_zero_intensity": "0"}
    exact, noisy = (
        scan(lidar_settings(asked(**usual, noise_stddev=noise)), Placement(z=2.0), 0.0, rays()).points[:, :3]
        for noise in ("0", "0.1")
    )
    off = np.linalg.norm(noisy, axis=1) - np.linalg.norm(exact, axis=1)
    assert np.std(off) == pytest.approx(0.1, rel=0.1)
    assert np.cross(noisy, exact) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(
    ("name", "value"), [("channels", "0"), ("upper_fov", "80"), ("points_per_second", "1e9"), ("range", "nan")]
)
def test_what_no_lidar_has_is_refused(name: str, value: str) -> None:
    with pytest.raises(Refusal, match=f"found {name} '{value}'"):
        lidar_settings(asked(**{name: value}))
