"""One episode on a server: the ego, the others, and what is true of them, from the start to the last step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from caldrive.carla_bridge.client.actors import Actors
from caldrive.carla_bridge.client.connection import Connection
from caldrive.carla_bridge.client.ego import Ego
from caldrive.carla_bridge.client.sensors import RGB
from caldrive.carla_bridge.client.traffic import populate
from caldrive.datatypes import CameraConfig, Contact, Control, VehicleState
from caldrive.geometry import moved
from caldrive.scenarios import Scenario
from caldrive.world.roads.route import Route
from caldrive.world.scene.weather import weather
from caldrive.world.town import Town
from caldrive.world.truth.label_rig import LabelRig, WorldState

SETTLE = 5  # steps that the ego stands before an episode, until it has come down to the road


class Episode:
    """state: who is where now; truth: all that is true of it. mounts: of the cameras that the agent looks through."""

    def __init__(
        self, connection: Connection, town: Town, scenario: Scenario, route: Route, mounts: Sequence[CameraConfig]
    ) -> None:
        self.town, self.scenario, self.route, self._connection = town, scenario, route, connection
        self._progress = 0.0
        carla, roads, (first, begin) = connection.carla, town.roads, route.lanes[0]
        start = route.line.pose_at(0.0)
        with connection.answers():
            connection.world.set_weather(getattr(carla.WeatherParameters, weather(scenario.weather).name))
            self._ego = Ego(connection, start, roads.lanes[first].height(-begin), roads.offset)
            self._ego.mount(mounts, RGB)
            populate(connection, scenario)
            for _ in range(SETTLE):
                self._tick()
            self._actors = Actors(connection, roads, self._ego.id)
            self._ego.hits()  # as it came down
            self._began = connection.time
            self.labels = LabelRig(town, route, scenario, self._ego.front_axle(), self._actors.lights())
            self._update(())

    def step(self, control: Control) -> None:
        """Moves everything on by a step."""
        before = self.state.ego
        self._ego.apply(control)
        self._tick()
        self._update(self._actors.contacts(self._ego.hits(), before))

    def displace(self, left: float, turn: float) -> None:
        """Puts the ego some metres to the left and turns it (rad)."""
        self._ego.put(moved(self.state.ego.pose, left=left, turn=turn))
        self._tick()
        self._update(self.state.contacts)

    def mount(self, mounts: Sequence[CameraConfig], *kinds: str) -> None:
        """Mounts cameras. Where there are new ones that takes a step; its contacts are the next step's."""
        if self._ego.mount(mounts, *kinds):
            self._tick()
            self._update(self.state.contacts)

    def look(self, mounts: Sequence[CameraConfig], kind: str) -> list[Any]:
        """CARLA's images of some cameras, as of now."""
        self.mount(mounts, kind)
        return [self._ego.image(mount, kind) for mount in mounts]

    def _tick(self) -> None:
        self._ego.wait_for(self._connection.tick())

    def _update(self, contacts: tuple[Contact, ...]) -> None:
        """Takes down who is where now, and what is true of it."""
        ego = self._ego.state()
        self._progress = self.route.line.project(ego.pose.x, ego.pose.y, near=self._progress).s
        self.state = WorldState(
            time=round(self._connection.time - self._began, 6), ego=ego, vehicles=self._cars(),
            pedestrians=self._actors.pedestrians(), lights=self._actors.lights(), contacts=contacts,
            progress=self._progress,
        )  # fmt: skip
        self.truth = self.labels.truth(self.state)

    def _cars(self) -> tuple[VehicleState, ...]:
        """All other cars but those on a bridge over the route, or below it."""
        level = self.labels.level
        return tuple(
            car
            for car, height in self._actors.vehicles()
            if level is None or level.holds(car.pose.x, car.pose.y, height, self._progress)
        )
