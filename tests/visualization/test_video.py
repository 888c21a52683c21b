"""The video: frames arrive whole, and each shows what the car saw, knew and did."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import av
import numpy as np
import pytest

from caldrive.control.longitudinal import DriveState
from caldrive.datatypes import (
    Affordances,
    Command,
    Control,
    Decision,
    Image,
    Observation,
    Pose,
    Step,
    Truth,
    VehicleState,
)
from caldrive.driving.tasks import task_scenarios
from caldrive.results import EpisodeResult, Infraction, InfractionKind, Outcome
from caldrive.scenarios import Scenario
from caldrive.visualization.episode_video import VideoWriter, caption
from caldrive.visualization.gauges import AMBER, GREEN, RED
from caldrive.visualization.hud import CAMERA, PANEL, SIZE, Hud, with_outcome
from caldrive.visualization.minimap import EGO, GOAL, ROUTE, MiniMap
from caldrive.world.roads.route import plan_route
from caldrive.world.roads.towns import load_roads
from tests.visualization.pixels import count

SCENARIO = task_scenarios("town02", "one-turn", 14)[0]
VIEW = np.full((CAMERA.height, CAMERA.width, 3), 200, np.uint8)
MAP_LEFT = CAMERA.width - PANEL


@pytest.fixture(scope="module")
def minimap() -> MiniMap:
    roads = load_roads("town02")
    return MiniMap(roads, plan_route(roads, SCENARIO.start, SCENARIO.goal), SCENARIO.goal, PANEL)


def step(
    seen: Affordances | None = None, control: Control | None = None, note: str = "", at: Pose | None = None
) -> Step:
    ego = VehicleState(at or SCENARIO.start, 5.0)
    observation = Observation(1.0, VIEW, 5.0, Command.LEFT)
    decision = Decision(control or Control(), seen or Affordances(), DriveState.CRUISING, 30.0, 20.0, note)
    return Step(observation, Truth(1.0, ego, Affordances()), decision.control, decision)


def panel(minimap: MiniMap, step: Step, truth: bool = False) -> Image:
    """The part under the camera's picture, left of the map."""
    return Hud("a drive", 60.0, minimap, truth).draw(VIEW, step, [])[CAMERA.height :, :MAP_LEFT]


def read(path: Path) -> tuple[list[Image], float]:
    with av.open(str(path)) as film:
        images = [np.asarray(frame.to_ndarray(format="rgb24"), np.uint8) for frame in film.decode(video=0)]
        return images, float(film.streams.video[0].average_rate or 0.0)


def test_a_video_has_all_its_frames_at_their_size_and_rate(tmp_path: Path) -> None:
    with VideoWriter(tmp_path / "film.mp4", rate=10.0) as video:
        for brightness in (40, 120, 200):
            video.add(np.full((64, 96, 3), brightness, np.uint8), times=2)
    frames, rate = read(tmp_path / "film.mp4")
    assert [frame.shape for frame in frames] == [(64, 96, 3)] * 6
    assert rate == 10.0
    assert [float(frame.mean()) for frame in frames[::2]] == pytest.approx([40, 120, 200], abs=4)


_ENCODE = """
import hashlib, sys
from pathlib import Path
import numpy as np
from caldrive.visualization.episode_video import VideoWriter
squares = np.random.default_rng(0).integers(0, 255, (12, 36, 3), dtype=np.uint8).repeat(8, 0).repeat(8, 1)
path = Path(sys.argv[1])
with VideoWriter(path) as video:
    for k in range(12):
        video.add(np.ascontiguousarray(squares[:, 4 * k : 4 * k + 192]))
print(hashlib.sha256(path.read_bytes()).hexdigest())
"""


def test_the_same_frames_give_the_same_bytes_whatever_lay_in_memory_before(tmp_path: Path) -> None:
    digests = []
    for byte in ("0", "1", "85"):  # glibc fills the memory that it hands out with a byte that follows from this one
        command = [sys.executable, "-c", _ENCODE, str(tmp_path / f"{byte}.mp4")]
        environment = {**os.environ, "MALLOC_PERTURB_": byte}
        digests.append(subprocess.run(command, check=True, capture_output=True, text=True, env=environment).stdout)
    assert len(set(digests)) == 1
    assert len(digests[0].strip()) == 64


def test_an_interrupted_video_leaves_no_file(tmp_path: Path) -> None:
    def film() -> None:
        with VideoWriter(tmp_path / "film.mp4") as video:
            video.add(np.zeros((64, 96, 3), np.uint8), times=100)
            assert any(tmp_path.iterdir())
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        film()
    assert list(tmp_path.iterdir()) == []


def test_a_video_without_frames_is_no_file(tmp_path: Path) -> None:
    with VideoWriter(tmp_path / "film.mp4"):
        pass
    assert list(tmp_path.iterdir()) == []


def test_a_frame_keeps_the_cameras_picture_and_has_even_sides(minimap: MiniMap) -> None:
    frame = Hud("a drive", 60.0, minimap, truth=False).draw(VIEW, step(), [])
    assert frame.shape == (SIZE[1], SIZE[0], 3)
    assert all(side % 2 == 0 for side in SIZE)
    assert (frame[100 : CAMERA.height] == 200).all()


def test_pedals_show_as_bars_that_grow(minimap: MiniMap) -> None:
    half, full = (panel(minimap, step(control=Control(throttle=share))) for share in (0.5, 1.0))
    assert 1.8 < count(full, GREEN) / count(half, GREEN) < 2.2
    assert count(panel(minimap, step(control=Control(brake=0.5))), RED) > count(half, RED)


def test_a_close_car_fills_its_gauge(minimap: MiniMap) -> None:
    far, near = (panel(minimap, step(Affordances(vehicle_distance=d))) for d in (40.0, 5.0))
    assert count(near, AMBER) > 3 * count(far, AMBER) > 0


def test_truth_stands_beside_only_where_it_is_asked_for(minimap: MiniMap) -> None:
    hazard = step(Affordances(hazard_stop=1.0))
    assert (panel(minimap, hazard, truth=True) != panel(minimap, hazard)).any()


def test_affordances_that_are_no_numbers_can_be_drawn(minimap: MiniMap) -> None:
    blind = step(Affordances(*(math.nan,) * 2, None, *(math.nan,) * 3), note="the image is black")
    assert count(panel(minimap, blind), AMBER) == 0


def test_the_map_shows_route_goal_and_the_ego_where_they_are(minimap: MiniMap) -> None:
    for pose in (SCENARIO.start, Pose(SCENARIO.goal.x, SCENARIO.goal.y + 20, 0.0)):
        picture = np.asarray(minimap.draw(step(at=pose).truth))
        assert count(picture, ROUTE) > 50
        assert count(picture, GOAL) > 20
        rows, columns = np.nonzero((picture == EGO).all(-1))
        [(x, y)] = minimap.pixels(np.array([(pose.x, pose.y)]))
        assert (columns.mean(), rows.mean()) == pytest.approx((x / 2, y / 2), abs=4)


def test_an_infraction_is_written_across_the_picture_for_a_while(minimap: MiniMap) -> None:
    hud = Hud("a drive", 60.0, minimap, truth=False)
    fresh = hud.draw(VIEW, step(), [Infraction(InfractionKind.SIDEWALK, 0.5, 0.0, 0.0)])
    stale = hud.draw(VIEW, step(), [Infraction(InfractionKind.SIDEWALK, -9.0, 0.0, 0.0)])
    assert count(fresh[: CAMERA.height], RED) > 1000
    assert count(stale[: CAMERA.height], RED) == 0


def test_the_outcome_is_written_across_the_last_frame() -> None:
    frame = np.zeros((SIZE[1], SIZE[0], 3), np.uint8)
    result = EpisodeResult(SCENARIO, Outcome.SUCCESS, 10.0, 50.0, 50.0, 50.0)
    reached, late = (with_outcome(frame, replace(result, outcome=o)) for o in (Outcome.SUCCESS, Outcome.TIMEOUT))
    assert reached.any()
    assert (reached != late).any()


def test_the_caption_names_town_task_weather_and_episode() -> None:
    scenario: Scenario = replace(SCENARIO, town="maps/Town01.xodr")
    text = caption(scenario, 2, 3)
    assert all(word in text for word in ("Town01.xodr", "one-turn", "14 SoftRainSunset", "episode 2 of 3"))
    assert "maps" not in text
