"""What clients did is recorded: who was where, what cameras saw, who came and went."""

from __future__ import annotations

import errno
from collections.abc import Iterator
from pathlib import Path

import pytest

from caldrive.carla_bridge.server.run_recording import RunRecording
from caldrive.carla_bridge.server.server import Server
from caldrive.carla_bridge.server.settings import ServerSettings
from caldrive.commands.serve_carla import make_server
from caldrive.visualization.channels import Content, Picture, Remark
from caldrive.visualization.scenes import Scene
from tests.carla_bridge.server.wire_client import Reader, WireClient, free_port

SETTINGS = ServerSettings(town="town01", port=free_port(), people=3, record=Path("run.mcap"))


class Notes:
    """A writer that keeps all in memory, until its disk is full."""

    def __init__(self) -> None:
        self.messages: list[tuple[str, float, Content]] = []
        self.is_full = False

    def write(self, topic: str, time: float, content: Content) -> None:
        if self.is_full:
            raise OSError(errno.ENOSPC, "No space left on device", "run.mcap")
        self.messages.append((topic, time, content))

    def of(self, topic: str) -> list[Content]:
        return [content for there, _, content in self.messages if there == topic]


@pytest.fixture(scope="module")
def notes() -> Notes:
    return Notes()


@pytest.fixture(scope="module")
def server(notes: Notes) -> Iterator[Server]:
    made = make_server(SETTINGS, RunRecording(notes))
    yield made
    made.close()


def test_a_clients_run_is_recorded_from_episode_to_episode(
    server: Server, notes: Notes, capsys: pytest.CaptureFixture[str]
) -> None:
    client = WireClient(server)
    client.synchronous()
    car = client.spawn("vehicle.tesla.model3", (*first_point(client),))
    camera = client.call(
        "spawn_actor_with_parent", [1, "sensor.camera.rgb", [["image_size_x", 4, "32"], ["image_size_y", 4, "16"]]],
        [[1.0, 0.0, 2.0], [0.0, 0.0, 0.0]], car, 0, "",
    )  # fmt: skip
    Reader(client, int.from_bytes(camera[5][:4], "little"))
    for _ in range(3):
        client.call("tick_cue")
    client.call("destroy_actor", car)
    client.call("tick_cue")
    client.call("load_new_episode", "", False, 0)
    client.call("tick_cue")
    said = [content.text for content in notes.of("/log") if isinstance(content, Remark)]
    assert said == [
        "an episode begins in town01", f"vehicle.tesla.model3 {car} comes", f"sensor.camera.rgb {camera[0]} comes",
        f"vehicle.tesla.model3 {car} goes", f"sensor.camera.rgb {camera[0]} goes", "an episode begins in town01",
    ]  # fmt: skip
    pictures = notes.of(f"/camera/{camera[0]}")
    assert len(pictures) == 3
    assert all(isinstance(picture, Picture) and picture.jpeg[:2] == b"\xff\xd8" for picture in pictures)
    cars = [len(scene.parts[0].boxes) for scene in notes.of("/clients") if isinstance(scene, Scene)]
    assert cars == [1, 1, 1, 0, 0]
    people = [len(scene.parts[1].boxes) for scene in notes.of("/inhabitants") if isinstance(scene, Scene)]
    assert people == [3] * 5
    assert len(notes.of("/map")) == 1
    times = [time for topic, time, _ in notes.messages if topic == "/clients"]
    assert times == pytest.approx([0.1, 0.2, 0.3, 0.4, 0.5])
    notes.is_full = True
    assert client.call("tick_cue") == server.frame
    assert client.call("tick_cue") == server.frame  # the server goes on
    assert (
        capsys.readouterr().err.count("found that run.mcap cannot be written any more (No space left on device)") == 1
    )
    client.leave()


def first_point(client: WireClient) -> tuple[float, float, float]:
    _, points = client.call("get_map_info")
    (x, y, _), (_, yaw, _) = points[0]
    return x, y, yaw
