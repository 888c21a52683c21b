"""The embedded world: a town with traffic, people, lights and a camera, in one process and without a server."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from caldrive.datatypes import DT, Affordances, Alternative, CameraConfig, Control, Image, Observation, Truth
from caldrive.scenarios import Scenario
from caldrive.timing import Stopwatch, Timed, untimed
from caldrive.world.episode import Episode
from caldrive.world.rendering.camera import CameraRig, Shot
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.roads.route import Route, plan_route
from caldrive.world.scene.weather import weather
from caldrive.world.town import Town, load_town
from caldrive.world.traffic.ego import VehicleConfig

NO_IMAGE = np.zeros((1, 1, 3), np.uint8)


class EmbeddedWorld:
    """Implements `RecordableWorld`.

    camera: the agent's; None drives without images (a black pixel stands for them), for the oracle. stopwatch: to
    measure the parts of a step with.
    """

    dt = DT

    def __init__(
        self,
        camera: CameraConfig | None = None,
        vehicle: VehicleConfig | None = None,
        stopwatch: Stopwatch | None = None,
    ) -> None:
        self.mount, self.vehicle = camera, vehicle or VehicleConfig()
        self._timed: Timed = stopwatch.part if stopwatch else untimed
        self._episode: Episode | None = None
        self._rig: CameraRig | None = None

    def reset(self, scenario: Scenario, *, route: Route | None = None, appearance: int = 0) -> Observation:
        """Starts an episode. route: instead of the shortest way; appearance: see `Town`.

        Raises ValueError or FileNotFoundError for a scenario that cannot be, RuntimeError where another world of this
        process has traffic.
        """
        weather(scenario.weather)
        town = load_town(scenario.town, appearance)
        route = route or plan_route(town.roads, scenario.start, scenario.goal)
        if self._episode is not None:
            self._episode.release()
        self._episode = Episode(town, scenario, route, self.vehicle, self._timed)
        return self._observe()

    def step(self, control: Control) -> Observation:
        """Moves everything on by dt."""
        self._now.step(control)
        return self._observe()

    def truth(self) -> Truth:
        """What really is, now."""
        return self._now.truth

    def close(self) -> None:
        """Ends the simulation and frees the camera."""
        if self._episode is not None:
            self._episode.close()
        self._episode = None
        self._put_camera_away()

    @property
    def _now(self) -> Episode:
        if self._episode is None:
            raise RuntimeError("found a world before its first episode, wanted one: call reset(scenario)")
        return self._episode

    @property
    def town(self) -> Town:
        return self._now.town

    @property
    def roads(self) -> RoadNetwork:
        return self._now.town.roads

    @property
    def route(self) -> Route:
        return self._now.route

    def displace(self, left: float, turn: float) -> Observation:
        """Puts the ego some metres to the left and turns it (rad)."""
        self._now.displace(left, turn)
        return self._observe()

    def images(self, mounts: Sequence[CameraConfig]) -> list[Image]:
        """What cameras on the ego see now, (H, W, 3) each."""
        return self._camera().render(self._shot(), mounts)

    def semantic_images(self, mounts: Sequence[CameraConfig]) -> list[NDArray[np.uint8]]:
        """What each pixel of `images` shows, (H, W) each, as numbers of `Semantic`."""
        return self._camera().render_semantics(self._shot(), mounts)

    def labels_at(self, mount: CameraConfig) -> Affordances:
        """The affordances of a car that stands where this camera of the ego looks from (the three-camera set-up)."""
        return self._now.labels.label_at(mount, self._now.moment)

    def other_commands_at(self, mount: CameraConfig) -> list[Alternative]:
        """What other commands would ask of such a car, where others could be given."""
        return self._now.labels.other_commands_at(mount, self._now.moment)

    def _shot(self) -> Shot:
        now = self._now.moment
        states = {light.id: light.state for light in now.lights}
        return Shot(self._now.scenario.weather, now.ego, now.vehicles, now.pedestrians, states, now.time)

    def _camera(self) -> CameraRig:
        """The town's camera rig, made when it is first needed."""
        if self._rig is not None and self._rig.town is not self._now.town:
            self._put_camera_away()
        if self._rig is None:
            self._rig = CameraRig(self._now.town)
        return self._rig

    def _put_camera_away(self) -> None:
        if self._rig is not None:
            self._rig.close()
        self._rig = None

    def _observe(self) -> Observation:
        now = self._now.moment
        with self._timed("camera"):
            image = self.images([self.mount])[0] if self.mount is not None else NO_IMAGE
        return Observation(now.time, image, now.ego.speed, self.route.command_at(now.progress))
