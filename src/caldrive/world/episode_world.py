"""What worlds that drive one episode at a time have in common: steps, observations, what is known of the episode."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Generic, Protocol, TypeVar

import numpy as np

from caldrive.datatypes import DT, Affordances, Alternative, CameraConfig, Control, Image, Observation, Truth
from caldrive.timing import Timed, untimed
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.roads.route import Route
from caldrive.world.town import Town
from caldrive.world.truth.label_rig import LabelRig, WorldState

NO_IMAGE = np.zeros((1, 1, 3), np.uint8)  # a black pixel


class DrivenEpisode(Protocol):
    """An episode from its start to its last step. state: who is where now; truth: all that is true of it."""

    town: Town
    route: Route
    labels: LabelRig
    state: WorldState
    truth: Truth

    def step(self, control: Control) -> None:
        """Moves everything on by DT."""
        ...

    def displace(self, left: float, turn: float) -> None:
        """Puts the ego some metres to the left and turns it (rad)."""
        ...


EpisodeT = TypeVar("EpisodeT", bound=DrivenEpisode)


class EpisodeWorld(ABC, Generic[EpisodeT]):
    """A `RecordableWorld` but for its beginnings, its ends and its pictures.

    camera: the agent's; None drives without images (a black pixel stands for them). auxiliary: a second camera, for an
    agent that asks for one.
    """

    dt = DT
    """s of one step."""

    def __init__(self, camera: CameraConfig | None, auxiliary: CameraConfig | None, timed: Timed = untimed) -> None:
        self.mount, self.auxiliary, self._timed = camera, auxiliary, timed
        self._episode: EpisodeT | None = None

    @abstractmethod
    def images(self, mounts: Sequence[CameraConfig]) -> list[Image]:
        """What cameras on the ego see now, (H, W, 3) each."""

    def step(self, control: Control) -> Observation:
        """Moves everything on by dt."""
        self._current.step(control)
        return self._observe()

    def displace(self, left: float, turn: float) -> Observation:
        """Puts the ego some metres to the left and turns it (rad)."""
        self._current.displace(left, turn)
        return self._observe()

    def truth(self) -> Truth:
        """What really is, now."""
        return self._current.truth

    @property
    def roads(self) -> RoadNetwork:
        """The town's."""
        return self._current.town.roads

    @property
    def route(self) -> Route:
        """From the start to the goal of the episode."""
        return self._current.route

    def labels_at(self, mount: CameraConfig) -> Affordances:
        """The affordances of a car that stands where this camera of the ego looks from (the three-camera set-up)."""
        return self._current.labels.label_at(mount, self._current.state)

    def other_commands_at(self, mount: CameraConfig) -> list[Alternative]:
        """What other commands would ask of such a car, where others could be given."""
        return self._current.labels.other_commands_at(mount, self._current.state)

    @property
    def _current(self) -> EpisodeT:
        if self._episode is None:
            raise RuntimeError("found a world before its first episode, wanted one: call reset(scenario)")
        return self._episode

    def _observe(self) -> Observation:
        state = self._current.state
        with self._timed("camera"):
            image = self.images([self.mount])[0] if self.mount is not None else NO_IMAGE
            aside = self.images([self.auxiliary])[0] if self.auxiliary is not None else None
        return Observation(
            time=state.time, image=image, speed=state.ego.speed, command=self.route.command_at(state.progress),
            auxiliary=aside,
        )  # fmt: skip
