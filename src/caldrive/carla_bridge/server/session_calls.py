"""The calls about the session: versions, settings, ticks, maps, the weather, and the registry of traffic managers."""

from __future__ import annotations

import zlib
from typing import Any

from caldrive.carla_bridge.server.actor_calls import finite
from caldrive.carla_bridge.server.calls import call
from caldrive.carla_bridge.server.layouts import Settings, Weather, transform
from caldrive.carla_bridge.server.maps import PREFIX, map_name, opendrive, spawn_points
from caldrive.carla_bridge.server.navigation import navigation_mesh
from caldrive.carla_bridge.server.server import LONGEST_STEP, Server
from caldrive.carla_bridge.server.streams import WORLD
from caldrive.carla_bridge.server.wire import Refusal

VERSION = "0.9.16"
Token = tuple[bytes]


class SessionCalls:
    """They answer from one server."""

    def __init__(self, server: Server) -> None:
        self._server = server

    @call("version")
    def version(self, caller: int) -> str:
        """Which CARLA this stands for."""
        return VERSION

    @call("get_episode_info")
    def episode_info(self, caller: int) -> tuple[int, Token]:
        """The episode, and the stream of its snapshots."""
        return self._server.episode.number, (self._server.streams.token(WORLD),)

    @call("get_sensor_token")
    def sensor_token(self, caller: int, stream: int) -> Token:
        """A client is about to subscribe to a stream."""
        known = stream == WORLD or any(one.stream == stream for one in self._server.sensors())
        if not known:
            raise Refusal(f"found no stream {stream}, wanted that of a sensor that is there: spawn one")
        self._server.streams.announce(stream)
        return (self._server.streams.token(stream),)

    @call("get_episode_settings")
    def settings(self, caller: int) -> Settings:
        """The settings."""
        return self._server.rules

    @call("set_episode_settings")
    def set_settings(self, caller: int, settings: Settings) -> int:
        """New settings; the caller answers for them from now on."""
        delta, is_free = settings.delta, settings.fixed_delta in ((False,), (True, 0))
        if not is_free and not (delta is not None and 0.001 <= delta <= LONGEST_STEP):
            raise Refusal(
                f"found fixed_delta_seconds {delta}, wanted 0.001 to {LONGEST_STEP:g}, or 0 for steps by the clock: "
                "set fixed_delta_seconds = 0.1"
            )
        self._server.set_rules(settings, caller)
        return self._server.frame

    @call("tick_cue")
    def tick(self, caller: int) -> int:
        """A step, in synchronous mode."""
        return self._server.tick() if self._server.rules.synchronous else self._server.frame + 1

    @call("get_map_info")
    def map_info(self, caller: int) -> tuple[str, list[Any]]:
        """The map's name, and where vehicles may be spawned."""
        roads = self._server.episode.town.roads
        return map_name(roads), [transform(place) for place in spawn_points(roads)]

    @call("get_map_data")
    def map_data(self, caller: int) -> str:
        """The map as OpenDRIVE."""
        town = self._server.episode.town
        return opendrive(town.name, town.roads)

    @call("get_required_files")
    def required_files(self, caller: int, folder: str = "") -> list[str]:
        """Files that a client should keep: where its crowd may walk."""
        return [self._navigation[0]] if folder == "Nav" and self._navigation else []

    @call("request_file")
    def file(self, caller: int, name: str) -> bytes:
        """One of these."""
        if self._navigation is None or name != self._navigation[0]:
            raise Refusal(f"found no file {name[:200]!r}, wanted one that get_required_files names")
        return self._navigation[1]

    @property
    def _navigation(self) -> tuple[str, bytes] | None:
        """The name and the content of the file for crowds; clients keep it, so its name says what is in it."""
        roads = self._server.episode.town.roads
        content = navigation_mesh(roads)
        return (f"{PREFIX}Nav/{roads.name}-{zlib.crc32(content):08x}.bin", content) if content else None

    @call("get_available_maps")
    def maps(self, caller: int) -> list[str]:
        """What `load_world` takes."""
        return [f"/Game/{PREFIX}{name}" for name in self._server.maps.names()]

    @call("load_new_episode")
    def load(self, caller: int, name: str, reset_settings: bool = True, layers: int = 0) -> None:
        """A new episode, in the same town where the name is empty."""
        town = self._server.maps.town(name) if name else None
        try:
            self._server.begin(town)
        except (ValueError, OSError, RuntimeError) as error:
            raise Refusal(str(error)) from error
        if reset_settings:
            self._server.reset_rules()

    @call("copy_opendrive_to_file")
    def copy_opendrive(self, caller: int, content: str, parameters: list[Any]) -> None:
        """A map of the client's own."""
        raise Refusal(
            "found generate_opendrive_world, which caldrive does not serve, wanted a map that the server has: start it "
            "with --town FILE.xodr"
        )

    @call("load_map_layer")
    def load_layer(self, caller: int, layer: int) -> None:
        """The town is drawn whole."""

    @call("unload_map_layer")
    def unload_layer(self, caller: int, layer: int) -> None:
        """Likewise."""

    @call("get_weather_parameters")
    def weather(self, caller: int) -> Weather:
        """As it was set."""
        return self._server.episode.weather

    @call("set_weather_parameters")
    def set_weather(self, caller: int, weather: Weather) -> None:
        """What of it is drawn: see `weather`."""
        self._server.episode.set_weather(weather)

    @call("get_imui_gravity")
    def gravity(self, caller: int) -> float:
        """m/s² that IMUs feel."""
        return self._server.episode.gravity

    @call("set_imui_gravity")
    def set_gravity(self, caller: int, gravity: float) -> None:
        """Another one, for IMUs alone."""
        self._server.episode.gravity = finite(gravity, 1e3)

    @call("query_lights_state")
    def street_lights(self, caller: int, endpoint: str = "") -> list[Any]:
        """There is no night, and there are no lit street lamps."""
        return []

    @call("get_navigation_mesh")
    def navigation_mesh(self, caller: int) -> bytes:
        """The same without a file."""
        return self._navigation[1] if self._navigation else b""

    @call("is_traffic_manager_running")
    def has_manager(self, caller: int, port: int) -> bool:
        """Whether a client runs one."""
        return port in self._server.managers

    @call("get_traffic_manager_running")
    def manager(self, caller: int, port: int) -> tuple[str, int]:
        """Where it runs."""
        return (self._server.managers[port][0], port) if port in self._server.managers else ("", 0)

    @call("add_traffic_manager_running")
    def add_manager(self, caller: int, place: tuple[str, int]) -> bool:
        """A client runs one."""
        host, port = place
        if port in self._server.managers:
            return False
        self._server.managers[port] = host, caller
        return True

    @call("destroy_traffic_manager")
    def remove_manager(self, caller: int, port: int) -> bool:
        """It has ended."""
        return self._server.managers.pop(port, None) is not None
