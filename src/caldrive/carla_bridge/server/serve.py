"""A server with all its calls, from its settings to its end."""

from __future__ import annotations

from caldrive.carla_bridge.server.actor_calls import ActorCalls
from caldrive.carla_bridge.server.batch import Batches
from caldrive.carla_bridge.server.calls import calls_of
from caldrive.carla_bridge.server.server import Server
from caldrive.carla_bridge.server.session_calls import SessionCalls
from caldrive.carla_bridge.server.settings import ServerSettings
from caldrive.carla_bridge.server.vehicle_calls import VehicleCalls
from caldrive.carla_bridge.server.world_calls import WorldCalls, other_calls


def make_server(settings: ServerSettings) -> Server:
    """A server that waits for clients. Raises OSError where a port is taken, ValueError for a town that cannot be."""
    server = Server(settings)
    actors = ActorCalls(server)
    vehicles = VehicleCalls(server, actors)
    tables = (SessionCalls(server), actors, vehicles, Batches(server, actors, vehicles), WorldCalls(server))
    server.calls = other_calls()
    for table in tables:
        server.calls |= calls_of(table)
    return server
