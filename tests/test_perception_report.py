"""How well a network sees, by what it looks at."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from caldrive.episodes import EpisodeWriter
from caldrive.perception.dataset import Frames
from caldrive.perception.evaluation import outputs_on
from caldrive.perception.folders import find_episodes
from caldrive.perception.network import Network
from caldrive.perception.report import errors, report
from caldrive.perception.specs import SPECS
from tests.perception_data import HEIGHT, SCENARIO, TINY, WIDTH, make_frame

DISTANCE = next(spec for spec in SPECS if spec.name == "vehicle_distance")
AHEAD = (1.0, 4.0, 4.0, 8.0, 20.0, 30.0, 50.0, 50.0)


@pytest.fixture
def frames(tmp_path: Path) -> Frames:
    with EpisodeWriter(tmp_path / "one.parquet", SCENARIO) as writer:
        for index, distance in enumerate(AHEAD):
            frame = make_frame(index)
            affordances = replace(frame.affordances, vehicle_distance=distance)
            writer.append(replace(frame, affordances=affordances, camera_yaw=-0.2 if index < 3 else 0.1))
    return Frames(find_episodes(tmp_path), (HEIGHT, WIDTH))


def test_errors_are_told_apart_by_what_is_ahead_and_by_place_and_by_the_cameras_yaw(frames: Frames) -> None:
    network = Network(TINY).eval()
    found = report(network, frames, network.features)
    assert found.frames == len(AHEAD)
    cars = found.groups["car ahead"]
    assert list(cars) == ["00 to 03 m", "03 to 06 m", "06 to 12 m", "12 to 25 m", "25 to 50 m", "none"]
    weights = dict(zip(cars, (1, 2, 1, 1, 1, 2), strict=True))
    mean = sum(n * cars[name]["vehicle_distance/mae"] for name, n in weights.items()) / len(AHEAD)
    assert mean == pytest.approx(found.overall["vehicle_distance/mae"], rel=1e-4)
    wrong = errors(DISTANCE, *outputs_on(network, frames, network.features)[1:])
    assert cars["00 to 03 m"]["vehicle_distance/mae"] == pytest.approx(wrong[0], rel=1e-4)
    assert cars["25 to 50 m"]["vehicle_distance/mae"] == pytest.approx(wrong[5], rel=1e-4)
    places = {name: row["vehicle_distance/mae"] for name, row in found.groups["place"].items()}
    inside = np.array(frames.junction)
    assert 0 < inside.sum() < len(inside)
    wanted = {"in a junction": wrong[inside].mean(), "on a street": wrong[~inside].mean()}
    assert places == pytest.approx(wanted, rel=1e-4)
    turned = {name: row["vehicle_distance/mae"] for name, row in found.groups["camera turned"].items()}
    assert turned == pytest.approx({"05 to 10 °": wrong[3:].mean(), "10 ° and more": wrong[:3].mean()}, rel=1e-4)
    assert set(found.groups["command"]) == {"left", "straight"}
