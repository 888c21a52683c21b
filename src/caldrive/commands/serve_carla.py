"""The verb that serves the embedded world to CARLA's client, and the server with all its calls."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from caldrive.carla_bridge.server.settings import ServerSettings
from caldrive.checks import require_writable_file
from caldrive.commands.answer import Answer, Output
from caldrive.progress import Progress

if TYPE_CHECKING:  # it needs msgpack, which may be missing
    from caldrive.carla_bridge.server.run_recording import RunRecording
    from caldrive.carla_bridge.server.server import Server


@dataclass(frozen=True, kw_only=True)
class ServeCarla(ServerSettings, Output):
    """Let CARLA's client drive in the embedded world, until Ctrl-C."""

    def run(self, progress: Progress) -> Answer:
        """Serves; answers when it is stopped."""
        signal.signal(signal.SIGTERM, signal.default_int_handler)  # what is recorded is written to its end, too
        progress(f"loading {self.town}", 0.0)
        with _recording(self.record) as recording, closing(make_server(self, recording)) as server:
            progress("getting ready to draw", 0.5)
            server.warm_up()
            progress(f"serving {self.town}", 1.0)
            server.log(f"CARLA's client may connect to {self.host}:{self.port} ({self.town}); Ctrl-C ends it")
            with suppress(KeyboardInterrupt):
                server.run()
        return Answer({"port": self.port}, "stopped")


@contextmanager
def _recording(path: Path | None) -> Iterator[RunRecording | None]:
    """What is told of all that clients do, None without a file. Raises ValueError, OSError or RuntimeError where it
    cannot be written."""
    if path is None:
        yield None
        return
    from caldrive.visualization.mcap_file import ENDING, McapFile

    require_writable_file(path, "--record", ENDING)
    with McapFile(path, keeps=True) as file:
        from caldrive.carla_bridge.server.run_recording import RunRecording

        yield RunRecording(file)


def make_server(settings: ServerSettings, recording: RunRecording | None = None) -> Server:
    """A server that waits for clients. Raises OSError where a port is taken, ValueError for a town that cannot be,
    RuntimeError without msgpack."""
    try:
        from caldrive.carla_bridge.server.actor_calls import ActorCalls
    except ModuleNotFoundError as error:
        if error.name != "msgpack":
            raise
        raise RuntimeError(
            "found no msgpack, wanted it to speak with CARLA's client: type pip install 'caldrive[serve]'"
        ) from error
    from caldrive.carla_bridge.server.batch import Batches
    from caldrive.carla_bridge.server.calls import calls_of
    from caldrive.carla_bridge.server.light_calls import LightCalls
    from caldrive.carla_bridge.server.server import Server
    from caldrive.carla_bridge.server.session_calls import SessionCalls
    from caldrive.carla_bridge.server.vehicle_calls import VehicleCalls
    from caldrive.carla_bridge.server.world_calls import WorldCalls, other_calls

    server = Server(settings, recording)
    actors = ActorCalls(server)
    vehicles, lights = VehicleCalls(server, actors), LightCalls(server, actors)
    others = SessionCalls(server), Batches(server, actors, vehicles, lights), WorldCalls(server)
    server.calls = other_calls()
    for table in (actors, vehicles, lights, *others):
        server.calls |= calls_of(table)
    return server
