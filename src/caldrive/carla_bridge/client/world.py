"""CARLA as a world: the same scenarios, labels, referee and recordings as in the embedded one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from caldrive.carla_bridge.client.connection import Connection
from caldrive.carla_bridge.client.episode import Episode
from caldrive.carla_bridge.client.sensors import RGB, SEMANTIC, classes, picture
from caldrive.datatypes import CameraConfig, Image, Observation
from caldrive.scenarios import Scenario
from caldrive.world.episode_world import EpisodeWorld
from caldrive.world.roads.route import Route, plan_route
from caldrive.world.scene.weather import weather
from caldrive.world.town import load_town


class CarlaWorld(EpisodeWorld[Episode]):
    """A CARLA server as a `RecordableWorld`, at 10 Hz in synchronous mode.

    camera: the agent's; None drives without images. auxiliary: a second one. A server has one world: who drives in it
    has it alone. `displace` takes a step of the world.
    """

    def __init__(
        self,
        camera: CameraConfig | None = None,
        host: str = "127.0.0.1",
        port: int = 2000,
        auxiliary: CameraConfig | None = None,
    ) -> None:
        super().__init__(camera, auxiliary)
        self._host, self._port = host, port
        self._connection: Connection | None = None

    def reset(self, scenario: Scenario, *, route: Route | None = None, appearance: int = 0) -> Observation:
        """Starts an episode; connects anew where the server has been started anew. appearance: is not heeded, as
        CARLA's towns have one only.

        Raises ValueError or FileNotFoundError for a scenario that cannot be, RuntimeError where no server answers.
        """
        weather(scenario.weather)
        try:
            connection = self._connected()
            town = load_town(connection.town_of(scenario.town))
            route = route or plan_route(town.roads, scenario.start, scenario.goal)
            mounts = [mount for mount in (self.mount, self.auxiliary) if mount is not None]
            self._episode = Episode(connection, town, scenario, route, mounts)
            return self._observe()
        except BaseException:
            self.close()
            raise

    def _connected(self) -> Connection:
        """A connection to a world without anything of ours."""
        connection, self._episode = self._connection, None
        if connection is not None and connection.is_alive():
            with connection.answers():
                connection.clear()
        else:
            self._connection = None
            if connection is not None and connection.has_manager:
                # It would be stepped together with the next server's, miss its own, and abort this process.
                raise RuntimeError(
                    f"found that the server at {self._host}:{self._port} has gone while CARLA's traffic manager drove "
                    "cars there, wanted the same one: start it again, and type this again; what is done is kept"
                )
            connection = self._connection = Connection(self._host, self._port)
        connection.synchronise()
        return connection

    def close(self) -> None:
        """Removes what was spawned, and puts the server's settings back."""
        connection, self._connection, self._episode = self._connection, None, None
        if connection is not None:
            connection.close()

    def images(self, mounts: Sequence[CameraConfig]) -> list[Image]:
        """What cameras on the ego see now, (H, W, 3) each. The first look from a place takes a step of the world."""
        return [picture(image) for image in self._current.look(mounts, RGB)]

    def semantic_images(self, mounts: Sequence[CameraConfig]) -> list[NDArray[np.uint8]]:
        """What each pixel of `images` shows, (H, W) each, as numbers of `Semantic`."""
        self._current.mount(mounts, RGB, SEMANTIC)  # at once, so that both see the same
        return [classes(image) for image in self._current.look(mounts, SEMANTIC)]
