"""Rerun is shown what a recording holds, on this machine alone. The library is a stand-in: it takes 170 MB."""

from __future__ import annotations

import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from caldrive.datatypes import Control, Decision, Pose, VehicleState
from caldrive.results import Infraction, InfractionKind
from caldrive.visualization import rerun_view
from caldrive.visualization.channels import DriveRecording
from caldrive.visualization.rerun_view import RerunView, open_viewer
from tests.command_line import refusal
from tests.fakes import StraightRoad
from tests.visualization.test_recording import CAMERA, ROAD, SCENARIO, step

Logged = dict[str, tuple[str, dict[Any, Any]]]  # by path: the archetype's name, and its arguments


class FakeRerun(SimpleNamespace):
    """Keeps what is logged last on each path."""

    def __init__(self) -> None:
        super().__init__(logged={}, times=[], url="", closed=False)
        for name in ("EncodedImage", "Scalars", "TextDocument", "TextLog", "Transform3D", "Boxes3D", "LineStrips3D"):
            setattr(self, name, self._archetype(name))
        self.Quaternion = lambda xyzw: tuple(xyzw)
        self.RecordingStream = lambda application: self

    def _archetype(self, name: str) -> Callable[..., Any]:
        def make(*values: Any, **named: Any) -> tuple[str, dict[Any, Any]]:
            return name, dict(enumerate(values)) | named

        return make

    def connect_grpc(self, url: str) -> None:
        self.url = url

    def disconnect(self) -> None:
        self.closed = True

    def set_time(self, timeline: str, duration: float) -> None:
        self.times.append(duration)

    def log(self, path: str, entity: Any) -> None:
        self.logged[path] = entity


@pytest.fixture
def rerun(monkeypatch: pytest.MonkeyPatch) -> FakeRerun:
    fake = FakeRerun()
    monkeypatch.setitem(sys.modules, "rerun", fake)
    monkeypatch.setattr(rerun_view, "open_viewer", lambda: 1234)
    return fake


def test_the_viewer_is_shown_what_a_recording_holds(rerun: FakeRerun) -> None:
    car = VehicleState(Pose(3.0, 4.0, 0.0), 1.0)
    infractions = [Infraction(InfractionKind.SIDEWALK, 0.0, 1.0, 2.0, at_fault=False)]
    with RerunView() as view:
        recording = DriveRecording([view], StraightRoad(), CAMERA)
        recording.begin(SCENARIO, "a drive", infractions)
        recording.add(step(0.0, Decision(Control(), state="cruising", target_speed=36.0), vehicles=(car,)))
        recording.add(step(0.1, vehicles=()))
        ends = [rerun.closed]
    logged: Logged = rerun.logged
    assert rerun.url == "rerun+http://127.0.0.1:1234/proxy"
    assert [*ends, rerun.closed] == [False, True]
    assert (min(rerun.times), max(rerun.times)) == (0.0, 0.1)
    assert logged["/camera"][0] == "EncodedImage"
    assert logged["/controller/state"] == ("TextDocument", {0: "cruising"})
    assert logged["/affordances/true/vehicle_distance"] == ("Scalars", {0: 50.0})
    assert logged["/infractions"][1]["level"] == "WARN"
    assert logged["/ego"][1]["translation"] == pytest.approx((10.1, 20.0, 0.0))
    assert len(logged["/ego/body/body/boxes"][1]["centers"]) == 1
    assert logged["/others/cars/boxes"][1]["centers"] == []  # the car has gone


class FakeViewer:
    """A process that listens on the port that it is told, or ends at once."""

    def __init__(self, opens: bool) -> None:
        self.opens, self.command, self.ended = opens, [""], not opens
        self.server: socket.socket | None = None

    def __call__(self, command: list[str], **_: Any) -> FakeViewer:
        self.command = command
        if self.opens:
            self.server = socket.create_server(("127.0.0.1", int(command[command.index("--port") + 1])))
        return self

    def poll(self) -> int | None:
        return 1 if self.ended else None

    def kill(self) -> None:
        self.ended = True


@pytest.fixture(params=[True, False], ids=["opens", "ends"])
def viewer(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[FakeViewer]:
    fake = FakeViewer(request.param)
    monkeypatch.setattr(subprocess, "Popen", fake)
    yield fake
    if fake.server:
        fake.server.close()


def test_the_viewer_listens_to_this_machine_alone_or_is_said_not_to_open(viewer: FakeViewer) -> None:
    if viewer.opens:
        assert open_viewer() == int(viewer.command[viewer.command.index("--port") + 1])
    else:
        with pytest.raises(RuntimeError, match=r"viewer does not open, wanted a display"):
            open_viewer()
    assert viewer.command[viewer.command.index("--bind") + 1] == "127.0.0.1"


def test_a_missing_rerun_is_named_before_the_drive(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Any
) -> None:
    monkeypatch.setitem(sys.modules, "rerun", None)
    said = refusal(capsys, *ROAD, "--agent", "oracle", "--view", "--out", str(tmp_path / "out"))
    assert "found no rerun, wanted it for --view: type pip install 'caldrive[view]'" in said
    assert list(tmp_path.iterdir()) == []
