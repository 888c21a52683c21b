"""A recording holds what the drive was: every channel, in order, in the schemas that viewers know."""

from __future__ import annotations

import errno
import io
import json
import math
import resource
import sys
from collections import defaultdict
from dataclasses import replace
from pathlib import Path
from typing import Any

import mcap.writer
import numpy as np
import pytest
import simplejpeg
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from scipy.spatial.transform import Rotation

from caldrive.affordances import SPECS
from caldrive.datatypes import (
    Affordances,
    CameraConfig,
    Command,
    Control,
    Decision,
    LightState,
    Observation,
    Pose,
    Step,
    TrafficLight,
    Truth,
    VehicleState,
)
from caldrive.driving.tasks import task_scenarios
from caldrive.results import EpisodeResult, Infraction, InfractionKind, Outcome
from caldrive.visualization import mcap_file as module
from caldrive.visualization.channels import DriveRecording, Picture, differences
from caldrive.visualization.mcap_file import McapFile
from caldrive.visualization.scenes import camera_place
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.roads.route import plan_route
from tests.command_line import refusal, run_json, write_agent
from tests.fakes import StraightRoad

CAMERA = CameraConfig(width=40, height=20)
SCENARIO = task_scenarios("town02", "one-turn", 14)[0]
IMAGE = np.linspace(0, 255, 20 * 40 * 3).reshape(20, 40, 3).astype(np.uint8)
RESULT = EpisodeResult(SCENARIO, Outcome.SUCCESS, 1.0, 1.0, 1.0, 1.0)
EACH_STEP = {
    "/ego": "foxglove.FrameTransform", "/camera": "foxglove.CompressedImage", "/others": "foxglove.SceneUpdate",
    "/affordances/true": "caldrive.Affordances", "/affordances/predicted": "caldrive.Affordances",
    "/controller": "caldrive.Controller", "/signals": "caldrive.Signals",
}  # fmt: skip
EACH_EPISODE = {
    "/map": "foxglove.SceneUpdate", "/route": "foxglove.SceneUpdate", "/ego/body": "foxglove.SceneUpdate",
    "/camera/place": "foxglove.FrameTransform", "/camera/calibration": "foxglove.CameraCalibration",
}  # fmt: skip
NOW_AND_THEN = {"/lights": "foxglove.SceneUpdate", "/episode": "foxglove.Log"}


class Read:
    """A file: by topic its schema, its times (s), its messages, and its channel's metadata."""

    def __init__(self, content: bytes) -> None:
        self.schemas: dict[str, str] = {}
        self.units: dict[str, dict[str, str]] = {}
        self.times: defaultdict[str, list[float]] = defaultdict(list)
        self.messages: defaultdict[str, list[Any]] = defaultdict(list)
        self.order: list[int] = []
        reader = make_reader(io.BytesIO(content), decoder_factories=[DecoderFactory()], validate_crcs=True)
        for schema, channel, message, decoded in reader.iter_decoded_messages(log_time_order=False):
            assert schema is not None
            assert (schema.encoding, channel.message_encoding) == ("protobuf", "protobuf")
            self.schemas[channel.topic], self.units[channel.topic] = schema.name, channel.metadata
            self.times[channel.topic].append(message.log_time / 1e9)
            self.messages[channel.topic].append(decoded)
            self.order.append(message.log_time)


def step(time: float = 0.0, decision: Decision | None = None, **truth: Any) -> Step:
    ego = VehicleState(Pose(10.0 + time, 20.0, math.pi / 2), 5.0 + time)
    observation = Observation(time, truth.pop("image", IMAGE), ego.speed, Command.LEFT)
    return Step(observation, Truth(time, ego, **{"affordances": Affordances(), **truth}), Control(0.5), decision)


def record(path: Path, *episodes: list[Step], world: Any = None, infractions: Any = (), **more: Any) -> Read:
    with McapFile(path) as file:
        recording = DriveRecording([file], world or StraightRoad(), CAMERA, **more)
        for k, steps in enumerate(episodes):
            recording.begin(SCENARIO, f"episode {k + 1}", infractions)
            for one in steps:
                recording.add(one)
            recording.end(RESULT)
    return Read(path.read_bytes())


TOWN = (
    "drive",
    "--agent",
    "oracle",
    "--town",
    "town02",
    "--task",
    "navigation-dynamic",
    "--seconds",
    "1",
    "--no-video",
)


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> tuple[Read, dict[str, list[Any]]]:
    """A drive of the oracle in town02, and its trace."""
    out = tmp_path_factory.mktemp("drive")
    report = run_json(*TOWN, "--record", str(out / "drive.mcap"), "--out", str(out))
    assert report["recording"] == str(out / "drive.mcap")
    return Read((out / "drive.mcap").read_bytes()), json.loads((out / "episode-000.json").read_text())["trace"]


def test_a_drive_has_every_channel_in_its_schema(drive: tuple[Read, dict[str, list[Any]]]) -> None:
    read, trace = drive
    assert read.schemas == EACH_STEP | EACH_EPISODE | NOW_AND_THEN
    assert {len(read.messages[topic]) for topic in EACH_STEP} == {len(trace["time"])}
    assert {len(read.messages[topic]) for topic in EACH_EPISODE} == {1}


def test_a_drive_is_the_same_without_a_recording(drive: tuple[Read, dict[str, list[Any]]], tmp_path: Path) -> None:
    assert run_json(*TOWN, "--out", str(tmp_path))["recording"] is None
    assert json.loads((tmp_path / "episode-000.json").read_text())["trace"] == drive[1]


def test_messages_come_in_the_order_of_the_drives_time(drive: tuple[Read, dict[str, list[Any]]]) -> None:
    read, trace = drive
    assert read.order == sorted(read.order)
    assert all(read.times[topic] == pytest.approx(trace["time"], abs=1e-6) for topic in EACH_STEP)
    stamps = [message.timestamp.ToNanoseconds() / 1e9 for message in read.messages["/camera"]]
    assert stamps == pytest.approx(trace["time"], abs=1e-6)


def test_values_are_those_of_the_trace(drive: tuple[Read, dict[str, list[Any]]]) -> None:
    read, trace = drive
    for kind in ("predicted", "true"):
        for spec in SPECS:
            found = [getattr(message, spec.name) for message in read.messages[f"/affordances/{kind}"]]
            assert found == pytest.approx([value or 0.0 for value in trace[f"{kind}_{spec.name}"]], abs=1e-4)
    assert [message.speed for message in read.messages["/signals"]] == pytest.approx(trace["speed"], abs=1e-4)
    assert [message.command for message in read.messages["/signals"]] == trace["command"]
    assert [message.state for message in read.messages["/controller"]] == trace["state"]
    assert [message.target_speed for message in read.messages["/controller"]] == pytest.approx(trace["target_speed"])
    places = [(message.translation.x, message.translation.y) for message in read.messages["/ego"]]
    assert places == [pytest.approx(place, abs=1e-3) for place in zip(trace["x"], trace["y"], strict=True)]


def test_channels_of_values_say_their_units(drive: tuple[Read, dict[str, list[Any]]]) -> None:
    read, _ = drive
    assert read.units["/affordances/predicted"] == {spec.name: spec.unit for spec in SPECS}
    assert read.units["/signals"]["acceleration"] == "m/s²"


def test_the_town_the_route_and_the_others_stand_where_they_are(
    drive: tuple[Read, dict[str, list[Any]]], town02: RoadNetwork
) -> None:
    read, trace = drive
    lanes = next(entity for entity in read.messages["/map"][0].entities if entity.id == "lanes")
    drawn = np.array([(p.x, p.y, p.z) for line in lanes.lines for p in line.points])
    assert drawn.min(0) == pytest.approx((*np.concatenate([x.line.points for x in town02.lanes.values()]).min(0), 0.0))
    route, goal = read.messages["/route"][0].entities
    way = np.array([(p.x, p.y) for p in route.lines[0].points])
    assert np.linalg.norm(way - (trace["x"][0], trace["y"][0]), axis=1).min() < 10.0
    end = goal.cubes[0].pose.position
    assert way[-1] == pytest.approx((end.x, end.y), abs=2.0)
    cars, people = read.messages["/others"][-1].entities
    assert len(cars.cubes) > 0 < len(people.cubes)
    assert all(cube.size.x > cube.size.y > 1.0 and cube.pose.position.z > 0 for cube in cars.cubes)


def test_the_picture_is_the_agents_image_and_attention_stands_beside_it(tmp_path: Path) -> None:
    seen = [None, np.full((6, 8, 3), 200, np.uint8)]
    read = record(tmp_path / "a.mcap", [step(0.0), step(0.1)], attention=lambda observation: seen.pop(0))
    image, attention = read.messages["/camera"][0], read.messages["/attention"]
    assert (image.format, image.frame_id) == ("jpeg", "camera")
    assert np.abs(simplejpeg.decode_jpeg(image.data, colorspace="RGB").astype(int) - IMAGE).mean() < 3
    assert [simplejpeg.decode_jpeg_header(message.data)[:2] for message in attention] == [(6, 8)]
    assert read.times["/attention"] == [0.1]


def test_a_grey_image_is_a_picture_too(tmp_path: Path) -> None:
    [picture] = record(tmp_path / "a.mcap", [step(image=IMAGE[..., 0])]).messages["/camera"]
    assert np.abs(simplejpeg.decode_jpeg(picture.data)[..., 2].astype(int) - IMAGE[..., 0]).mean() < 3


def test_episodes_follow_one_another_and_only_what_changes_is_said_again(tmp_path: Path, town02: RoadNetwork) -> None:
    world: Any = StraightRoad()
    world.roads, world.route = town02, plan_route(town02, SCENARIO.start, SCENARIO.goal)
    late = [step(time) for time in (100.0, 100.1)]  # a world whose clock goes on
    read = record(tmp_path / "a.mcap", [step(0.0), step(0.1)], late, world=world)
    assert read.times["/signals"] == pytest.approx([0.0, 0.1, 0.2, 0.3])
    assert (read.times["/map"], read.times["/route"]) == ([0.0], pytest.approx([0.0, 0.2]))
    assert [message.message for message in read.messages["/episode"]] == [
        "episode 1", "reached the goal in time", "episode 2", "reached the goal in time",
    ]  # fmt: skip


def test_what_an_agent_and_a_world_do_not_give_has_no_messages(tmp_path: Path) -> None:
    pixel = np.zeros((1, 1, 3), np.uint8)
    read = record(tmp_path / "a.mcap", [step(image=pixel), step(0.1, Decision(Control(), note="on"), image=pixel)])
    silent = {"/camera", "/camera/place", "/camera/calibration", "/affordances/predicted", "/map", "/route"}
    assert silent & set(read.messages) == set()
    [controller] = read.messages["/controller"]
    assert (controller.state, controller.note) == ("", "on")
    assert math.isnan(controller.speed_limit)
    assert math.isnan(read.messages["/signals"][0].target)


def test_a_calibration_is_left_out_where_the_image_is_another_cameras(tmp_path: Path) -> None:
    read = record(tmp_path / "a.mcap", [step(image=IMAGE[:10])])
    assert "/camera" in read.messages
    assert "/camera/calibration" not in read.messages


def test_infractions_are_lines_of_the_log_once_each(tmp_path: Path) -> None:
    found = [
        Infraction(InfractionKind.RED_LIGHT, 0.0, 1.0, 2.0), Infraction(InfractionKind.SIDEWALK, 0.0, 1.0, 2.0, False)
    ]  # fmt: skip
    read = record(tmp_path / "a.mcap", [step(0.0), step(0.1)], infractions=found)
    lines = [(message.level, message.message) for message in read.messages["/infractions"]]
    assert lines == [
        (4, "red light at (1.0, 2.0), the ego's fault"), (3, "sidewalk at (1.0, 2.0), not the ego's fault"),
    ]  # fmt: skip
    assert read.times["/infractions"] == [0.0, 0.0]


def test_lights_are_told_when_one_changes(tmp_path: Path) -> None:
    red = TrafficLight("a", Pose(0.0, 0.0, 0.0), LightState.RED, ((0.0, 2.0), (0.0, -2.0)))
    green = replace(red, state=LightState.GREEN)
    read = record(tmp_path / "a.mcap", [step(k / 10, lights=(light,)) for k, light in enumerate((red, red, green))])
    assert read.times["/lights"] == pytest.approx([0.0, 0.2])
    colors = [message.entities[0].cubes[0].color for message in read.messages["/lights"]]
    assert [color.r > color.g for color in colors] == [True, False]


def test_a_point_ahead_of_the_car_lies_where_the_camera_sees_it(tmp_path: Path) -> None:
    read = record(tmp_path / "a.mcap", [step()])
    [place], [lens] = read.messages["/camera/place"], read.messages["/camera/calibration"]
    q, origin = place.rotation, (place.translation.x, place.translation.y, place.translation.z)
    on_ground = np.array((CAMERA.forward + 10.0, 2.0, 0.0))  # in the ego's frame: ahead and to the left
    in_camera = Rotation.from_quat((q.x, q.y, q.z, q.w)).inv().apply(on_ground - origin)
    u, v, w = np.reshape(lens.K, (3, 3)) @ in_camera
    assert w == pytest.approx(10.0)
    assert (u / w, v / w) == pytest.approx((20 - 20 * 0.2, 10 + 20 * 0.12))  # a focal length of 20 pixels


def test_a_camera_that_is_turned_looks_where_it_is_turned_to() -> None:
    ahead = Rotation.from_quat(camera_place(replace(CAMERA, yaw=0.3)).rotation).apply((0.0, 0.0, 1.0))
    assert ahead == pytest.approx((math.cos(0.3), math.sin(0.3), 0.0))


def test_acceleration_and_jerk_are_those_of_a_known_motion() -> None:
    motion = [(time, 2 * time + 3 * time**2) for time in (0.1, 0.2, 0.3)]
    assert differences(motion) == pytest.approx((2 + 6 * 0.25, 6.0))
    assert differences(motion[:2]) == (pytest.approx(2 + 6 * 0.15), pytest.approx(math.nan, nan_ok=True))
    assert np.isnan(differences(motion[:1])).all()


def test_the_same_drive_gives_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a.mcap", "b.mcap"):
        record(tmp_path / name, [step(k / 10, Decision(Control(), Affordances())) for k in range(5)])
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()


def test_an_interrupted_recording_leaves_no_file(tmp_path: Path) -> None:
    def interrupted() -> None:
        with McapFile(tmp_path / "a.mcap") as file:
            recording = DriveRecording([file], StraightRoad(), CAMERA)
            recording.begin(SCENARIO, "", ())
            recording.add(step())
            assert any(tmp_path.iterdir())
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert list(tmp_path.iterdir()) == []


def test_a_disk_that_is_full_at_the_end_is_named_and_leaves_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: Any) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(mcap.writer.Writer, "finish", fail)
    with pytest.raises(OSError, match=r"No space left on device: .*a\.mcap"):
        record(tmp_path / "a.mcap", [step()])
    assert list(tmp_path.iterdir()) == []


def noise(k: int) -> Picture:
    """A picture of 50 kB that nothing can compress."""
    return Picture(np.random.default_rng(k).bytes(50_000))


def write_noise(path: Path, n: int) -> None:
    with McapFile(path, keeps=True) as file:
        for k in range(n):
            file.write("/camera", k / 10, noise(k))


@pytest.mark.parametrize(("room", "n"), [(330_000, 6), (1_030_000, 20)], ids=["while it is written", "at the end"])
def test_a_disk_that_is_full_keeps_whole_chunks_where_that_is_wanted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, room: int, n: int
) -> None:
    monkeypatch.setattr(module, "CHUNK", 100_000)
    usual = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, usual[1]))  # as full as a disk can be
    try:
        with pytest.raises(OSError, match=r"a\.mcap"):
            write_noise(tmp_path / "a.mcap", 21)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, usual)
    assert [path.name for path in tmp_path.iterdir()] == ["a.mcap"]
    kept = Read((tmp_path / "a.mcap").read_bytes()).messages["/camera"]
    assert [one.data for one in kept] == [noise(k).jpeg for k in range(n)]


ROAD = ("drive", "--world", "tests.fakes:StraightRoad", "--from", "0,0", "--to", "30,0", "--seconds", "0.5")


@pytest.mark.parametrize("more", [(), ("--no-video",)], ids=["video", "no video"])
def test_somebodys_agent_in_somebodys_world_is_recorded(more: tuple[str, ...], tmp_path: Path) -> None:
    agent = write_agent(tmp_path, "def act(self, observation):\n    return Control(throttle=0.5)")
    file = tmp_path / "new" / "a.mcap"
    run_json(*ROAD, "--agent", agent, *more, "--record", str(file), "--out", str(tmp_path / "out"))
    read = Read(file.read_bytes())
    assert set(read.schemas) == {
        "/ego", "/ego/body", "/camera", "/affordances/true", "/signals", "/others", "/episode",
    }  # fmt: skip
    assert len(read.messages["/signals"]) == 6


def test_a_bad_name_and_a_missing_library_are_named_before_the_drive(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    words = (*ROAD, "--agent", "oracle", "--out", str(tmp_path / "out"), "--record")
    assert "wanted a name that ends in .mcap: type --record" in refusal(capsys, *words, str(tmp_path / "a.txt"))
    monkeypatch.setitem(sys.modules, "mcap.writer", None)
    assert "type pip install 'caldrive[record]'" in refusal(capsys, *words, str(tmp_path / "a.mcap"))
    assert list(tmp_path.iterdir()) == []
