"""The verb that serves the embedded world to CARLA's client, and the server with all its calls."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from caldrive.carla_bridge.server.settings import ServerSettings
from caldrive.commands.answer import Answer, Output
from caldrive.progress import Progress

if TYPE_CHECKING:  # it needs msgpack, which may be missing
    from caldrive.carla_bridge.server.server import Server


@dataclass(frozen=True, kw_only=True)
class ServeCarla(ServerSettings, Output):
    """Let CARLA's client drive in the embedded world, until Ctrl-C."""

    def run(self, progress: Progress) -> Answer:
        """Serves; answers when it is stopped."""
        progress(f"loading {self.town}", 0.0)
        server = make_server(self)
        try:
            progress("getting ready to draw", 0.5)
            server.warm_up()
            progress(f"serving {self.town}", 1.0)
            server.log(f"CARLA's client may connect to {self.host}:{self.port} ({self.town}); Ctrl-C ends it")
            server.run()
        finally:
            server.close()
        return Answer({"port": self.port}, "served")


def make_server(settings: ServerSettings) -> Server:
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
    from caldrive.carla_bridge.server.server import Server
    from caldrive.carla_bridge.server.session_calls import SessionCalls
    from caldrive.carla_bridge.server.vehicle_calls import VehicleCalls
    from caldrive.carla_bridge.server.world_calls import WorldCalls, other_calls

    server = Server(settings)
    actors = ActorCalls(server)
    vehicles = VehicleCalls(server, actors)
    server.calls = other_calls()
    for table in (SessionCalls(server), actors, vehicles, Batches(server, actors, vehicles), WorldCalls(server)):
        server.calls |= calls_of(table)
    return server
