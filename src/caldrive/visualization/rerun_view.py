"""A drive's channels live in Rerun's viewer, on this machine only; needs the extra `view`."""

from __future__ import annotations

import socket
import subprocess
import sys
import time as clock
from functools import singledispatchmethod
from types import TracebackType
from typing import Any

import numpy as np

from caldrive.visualization.channels import Content, Picture, Remark, Values
from caldrive.visualization.scenes import Place, Scene, turned

HOST = "127.0.0.1"  # the viewer would listen to the whole network by itself
PATIENCE = 20.0  # s that it may take to open


def require_rerun() -> Any:
    """Rerun itself. Raises RuntimeError where it is not installed."""
    try:
        import rerun
    except ImportError as error:
        raise RuntimeError("found no rerun, wanted it for --view: type pip install 'caldrive[view]'") from error
    return rerun


class RerunView:
    """A `channels.Writer` that opens a viewer. In a `with` block it sends all that it was told; the viewer stays open.

    Raises RuntimeError where Rerun is missing, or its viewer does not open.
    """

    def __init__(self) -> None:
        self._rerun = require_rerun()
        port = open_viewer()
        self._stream = self._rerun.RecordingStream("caldrive")
        self._stream.connect_grpc(f"rerun+http://{HOST}:{port}/proxy")

    def write(self, topic: str, time: float, content: Content) -> None:
        """A message of a channel."""
        self._stream.set_time("time", duration=time)
        self._show(content, topic)

    def __enter__(self) -> RerunView:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        self._stream.disconnect()

    @singledispatchmethod
    def _show(self, content: Content, topic: str) -> None:
        """A camera's lens is left out: the picture stands in a view of its own."""

    @_show.register
    def _(self, content: Picture, topic: str) -> None:
        self._stream.log(topic, self._rerun.EncodedImage(contents=content.jpeg, media_type="image/jpeg"))

    @_show.register
    def _(self, content: Values, topic: str) -> None:
        for name, value in content.fields.items():
            kind = self._rerun.TextDocument if isinstance(value, str) else self._rerun.Scalars
            self._stream.log(f"{topic}/{name}", kind(value))

    @_show.register
    def _(self, content: Remark, topic: str) -> None:
        level = {"warning": "WARN"}.get(content.level, content.level.upper())
        self._stream.log(topic, self._rerun.TextLog(content.text, level=level))

    @_show.register
    def _(self, content: Place, topic: str) -> None:
        x, y, z, w = content.rotation
        rotation = self._rerun.Quaternion(xyzw=[x, y, z, w])
        self._stream.log(topic, self._rerun.Transform3D(translation=content.origin, quaternion=rotation))

    @_show.register
    def _(self, content: Scene, topic: str) -> None:
        # A body in the ego's frame moves with it, as its channel lies under that of the ego's place.
        for part in content.parts:
            self._stream.log(f"{topic}/{part.name}/boxes", self._rerun.Boxes3D(
                centers=[(box.pose.x, box.pose.y, box.up) for box in part.boxes],
                half_sizes=[np.array(box.size) / 2 for box in part.boxes],
                quaternions=[self._rerun.Quaternion(xyzw=list(turned(box.pose.heading))) for box in part.boxes],
                colors=[box.color for box in part.boxes],
            ))  # fmt: skip
            self._stream.log(f"{topic}/{part.name}/lines", self._rerun.LineStrips3D(
                [np.pad(line.points, ((0, 0), (0, 1))) for line in part.lines],
                radii=[line.width / 2 for line in part.lines],
                colors=[line.color for line in part.lines],
            ))  # fmt: skip


def open_viewer() -> int:
    """Opens a viewer that listens on a free port of this machine alone; returns the port.

    Raises RuntimeError where it does not open, as on a machine without a display.
    """
    port = _free_port()
    command = [sys.executable, "-m", "rerun", "--bind", HOST, "--port", str(port), "--expect-data-soon"]
    viewer = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, start_new_session=True)
    until = clock.monotonic() + PATIENCE
    while clock.monotonic() < until and viewer.poll() is None:
        try:
            with socket.create_connection((HOST, port), timeout=1.0):
                return port
        except OSError:
            clock.sleep(0.1)
    viewer.kill()
    raise RuntimeError("found that Rerun's viewer does not open, wanted a display for it: use --record FILE.mcap")


def _free_port() -> int:
    with socket.create_server((HOST, 0)) as server:
        port: int = server.getsockname()[1]
        return port
