"""The embedded world: a town with traffic, people, lights and a camera, in one process and without a server."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from caldrive.datatypes import CameraConfig, Image, Observation
from caldrive.scenarios import Scenario
from caldrive.timing import Stopwatch, untimed
from caldrive.world.episode import Episode
from caldrive.world.episode_world import EpisodeWorld
from caldrive.world.rendering.camera import CameraRig, SceneState
from caldrive.world.roads.route import Route, plan_route
from caldrive.world.scene.weather import weather
from caldrive.world.town import Town, load_town
from caldrive.world.traffic.ego import VehicleConfig


class EmbeddedWorld(EpisodeWorld[Episode]):
    """A town with traffic, pedestrians, lights and cameras; implements `RecordableWorld`.

    camera: the agent's; None drives without images (a black pixel stands for them), for the oracle. vehicle: the ego.
    stopwatch: to measure the parts of a step with. auxiliary: a second camera, for an agent that asks for one. A
    process may have several worlds, but only one of them traffic.
    """

    def __init__(
        self,
        camera: CameraConfig | None = None,
        vehicle: VehicleConfig | None = None,
        stopwatch: Stopwatch | None = None,
        auxiliary: CameraConfig | None = None,
    ) -> None:
        super().__init__(camera, auxiliary, stopwatch.part if stopwatch else untimed)
        self.vehicle = vehicle or VehicleConfig()
        self._rig: CameraRig | None = None

    def reset(self, scenario: Scenario, *, route: Route | None = None, appearance: int = 0) -> Observation:
        """Starts an episode. route: instead of the shortest way; appearance: see `load_town`.

        Raises ValueError or FileNotFoundError for a scenario that cannot be, RuntimeError where another world of this
        process has traffic.
        """
        weather(scenario.weather)
        town = load_town(scenario.town, appearance)
        route = route or plan_route(town.roads, scenario.start, scenario.goal)
        if self._episode is not None:
            self._episode.release()
        self._episode = Episode(town, scenario, route, self.vehicle, self._timed)
        try:
            return self._observe()
        except BaseException:
            self.close()  # without its first image there is no episode
            raise

    def close(self) -> None:
        """Ends the simulation and frees the camera."""
        if self._episode is not None:
            self._episode.close()
        self._episode = None
        self._close_camera()

    @property
    def town(self) -> Town:
        """Where the episode is."""
        return self._current.town

    def images(self, mounts: Sequence[CameraConfig]) -> list[Image]:
        """What cameras on the ego see now, (H, W, 3) each."""
        return self._camera().render(self.scene(), mounts)

    def semantic_images(self, mounts: Sequence[CameraConfig]) -> list[NDArray[np.uint8]]:
        """What each pixel of `images` shows, (H, W) each, as numbers of `Semantic`."""
        return self._camera().render_semantics(self.scene(), mounts)

    def scene(self) -> SceneState:
        """What `images` shows now, beside the town."""
        state = self._current.state
        return SceneState(
            weather=self._current.scenario.weather,
            ego=state.ego,
            vehicles=state.vehicles,
            pedestrians=state.pedestrians,
            lights={light.id: light.state for light in state.lights},
            time=state.time,
        )

    def _camera(self) -> CameraRig:
        """The town's camera rig, made when it is first needed."""
        if self._rig is not None and self._rig.town is not self._current.town:
            self._close_camera()
        if self._rig is None:
            self._rig = CameraRig(self._current.town)
        return self._rig

    def _close_camera(self) -> None:
        if self._rig is not None:
            self._rig.close()
        self._rig = None
