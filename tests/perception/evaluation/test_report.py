"""How well a network sees, by what it looks at."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from caldrive.affordances import BY_NAME
from caldrive.commands.tables import evaluation_table
from caldrive.perception.dataset.frames import Frames
from caldrive.perception.evaluation.evaluate import outputs_on
from caldrive.perception.evaluation.report import (
    PUBLISHED,
    WORST,
    errors,
    published_figures,
    published_metrics,
    report,
    worst,
)
from caldrive.perception.network.network import Network
from caldrive.recordings.folder import find_episodes
from caldrive.recordings.writer import EpisodeWriter
from tests.perception.data import HEIGHT, SCENARIO, TINY, WIDTH, make_frame, record

DISTANCE = BY_NAME["vehicle_distance"]
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
    evaluation = report(network, frames, network.features)
    assert evaluation.frames == len(AHEAD)
    cars = evaluation.groups["car ahead"]
    assert list(cars) == ["00 to 03 m", "03 to 06 m", "06 to 12 m", "12 to 25 m", "25 to 50 m", "none"]
    weights = dict(zip(cars, (1, 2, 1, 1, 1, 2), strict=True))
    mean = sum(n * (cars[name]["vehicle_distance/mae"] or 0.0) for name, n in weights.items()) / len(AHEAD)
    assert mean == pytest.approx(evaluation.overall["vehicle_distance/mae"], rel=1e-4)
    wrong = errors(DISTANCE, *outputs_on(network, frames, network.features))
    assert cars["00 to 03 m"]["vehicle_distance/mae"] == pytest.approx(wrong[0], rel=1e-4)
    assert cars["25 to 50 m"]["vehicle_distance/mae"] == pytest.approx(wrong[5], rel=1e-4)
    places = {name: row["vehicle_distance/mae"] for name, row in evaluation.groups["place"].items()}
    inside = np.array(frames.column("junction"))
    assert 0 < inside.sum() < len(inside)
    expected = {"in a junction": wrong[inside].mean(), "on a street": wrong[~inside].mean()}
    assert places == pytest.approx(expected, rel=1e-4)
    turned = {name: row["vehicle_distance/mae"] for name, row in evaluation.groups["camera turned"].items()}
    assert turned == pytest.approx({"05 to 10 °": wrong[3:].mean(), "10 ° and more": wrong[:3].mean()}, rel=1e-4)
    assert set(evaluation.groups["command"]) == {"left", "straight"}


def test_the_worst_frames_are_of_times_apart_whichever_camera_saw_them(tmp_path: Path) -> None:
    frames = Frames(find_episodes(record(tmp_path, n_episodes=2, n_frames=80, n_cameras=2)), (HEIGHT, WIDTH))
    wrong = np.zeros(len(frames))
    place = {(e, t, c): i for i, (e, t, c) in enumerate(_places(frames))}
    for error, where in ((9, (0, 10, 0)), (8, (0, 10, 1)), (7, (0, 30, 1)), (6, (1, 10, 0)), (5, (0, 45, 1))):
        wrong[place[where]] = error
    chosen = worst(wrong, frames)
    assert chosen[:3] == [place[0, 10, 0], place[1, 10, 0], place[0, 45, 1]]
    assert len(chosen) == WORST


def _places(frames: Frames) -> list[tuple[int, int, int]]:
    """Episode, time step and camera of each frame."""
    cameras = [episode.columns["camera"][row] for episode, row in map(frames.source, range(len(frames)))]
    return [(int(e), int(t), int(c)) for e, t, c in zip(frames.episode, frames.time_step, cameras, strict=True)]


def test_the_worst_frames_are_drawn_with_what_was_seen_and_what_was_true(frames: Frames, tmp_path: Path) -> None:
    network = Network(TINY).eval()
    report(network, frames, network.features, tmp_path / "worst.png")
    assert (tmp_path / "worst.png").read_bytes().startswith(b"\x89PNG")


def test_figures_are_told_apart_by_weather_and_town_and_classes_that_are_confused_are_counted(tmp_path: Path) -> None:
    for number, (town, weather) in enumerate((("town01", 1), ("town01", 3), ("town02", 3))):
        record(tmp_path / str(number), n_episodes=1, scenario=replace(SCENARIO, town=town, weather=weather))
    frames, network = Frames(find_episodes(tmp_path), (HEIGHT, WIDTH)), Network(TINY).eval()
    evaluation = report(network, frames, network.features)
    outputs, targets = outputs_on(network, frames, network.features)
    wrong = errors(DISTANCE, outputs, targets).reshape(3, -1).mean(axis=1)  # by episode
    for kind, expected in (("weather", {"1": wrong[0], "3": wrong[1:].mean()}), ("town", {"town01": wrong[:2].mean()})):
        for value, error in expected.items():
            assert evaluation.groups[kind][value]["vehicle_distance/mae"] == pytest.approx(error, rel=1e-4)
    seen, true = outputs["hazard_stop"].argmax(1), targets["hazard_stop"]
    expected_counts = [[int(((true == t) & (seen == s)).sum()) for s in (0, 1)] for t in (0, 1)]
    assert evaluation.confusion["hazard_stop"] == expected_counts


def test_the_papers_figures_stand_beside_a_networks_by_the_same_names(frames: Frames) -> None:
    network = Network(TINY).eval()
    overall = report(network, frames, network.features).overall
    assert len(PUBLISHED) == len(published_metrics()) == len(published_figures()) == 6
    assert (published_metrics().keys() | published_figures().keys()) <= overall.keys()
    assert published_metrics()["vehicle_distance/mae_scaled"] == 0.03289
    assert published_figures()["vehicle_distance/mae"] == pytest.approx(50 * 0.03289)
    assert published_figures()["red_light/iou"] == published_metrics()["red_light/iou"] == 0.9395


def test_a_class_that_never_occurred_has_no_figure_in_json_and_a_dash_in_the_table(frames: Frames) -> None:
    network = Network(TINY).eval()
    for name in ("red_light", "speed_sign"):
        network.get_parameter(f"blocks.{name}.groups.0.output.bias").data[0] = 1e6  # never seen, and never there
    evaluation = report(network, frames, network.features)
    assert evaluation.overall["red_light/iou"] is None
    assert evaluation.groups["command"]["left"]["speed_sign/iou"] is None
    assert evaluation.class_iou["red_light"] == [1.0, None]
    console = Console(width=200)
    with console.capture() as shown:
        console.print(evaluation_table(evaluation, "fp32"))
    line = next(line for line in shown.get().splitlines() if line.strip().startswith("all frames"))
    assert line.split()[3:5] == ["-", "-"]
