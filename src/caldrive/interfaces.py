"""The seams of caldrive: a world to drive in, an agent that acts, and CAL's two halves, perception and controller.

Whoever needs one names the protocol, never a class; `driving.setup.make_world` and `agents.registry` know the names.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from inspect import getattr_static
from typing import Any, Protocol, TypeGuard

import numpy as np
from numpy.typing import NDArray

from caldrive.datatypes import (
    Affordances,
    Alternative,
    CameraConfig,
    Command,
    Control,
    Decision,
    Image,
    Observation,
    Truth,
)
from caldrive.scenarios import Scenario

TruthSource = Callable[[], Truth]


class World(Protocol):
    """A place to drive. dt: seconds of one step."""

    dt: float

    def reset(self, scenario: Scenario) -> Observation:
        """Start an episode. Raises ValueError or FileNotFoundError for a scenario that cannot be."""
        ...

    def step(self, control: Control) -> Observation:
        """Move everything on by dt."""
        ...

    def truth(self) -> Truth:
        """What really is, now."""
        ...

    def close(self) -> None:
        """End the simulation."""
        ...


class MappedWorld(World, Protocol):
    """A world whose map and route are known: for minimaps and places. Its types are those of `world.roads`."""

    @property
    def roads(self) -> Any:
        """The map: a `RoadNetwork`."""
        ...

    @property
    def route(self) -> Any:
        """The way of this episode: a `Route`."""
        ...


class RecordableWorld(MappedWorld, Protocol):
    """A world that can be seen from anywhere on the car, with labels for each place: for films and recordings."""

    def reset(self, scenario: Scenario, *, route: Any = None, appearance: int = 0) -> Observation:
        """Start an episode, along a route of one's own and in a random appearance of the town where these are given."""
        ...

    def displace(self, left: float, turn: float) -> Observation:
        """Put the ego some metres to the left and turn it (rad)."""
        ...

    def images(self, mounts: Sequence[CameraConfig]) -> list[Image]:
        """What cameras on the ego see now, (H, W, 3) each."""
        ...

    def semantic_images(self, mounts: Sequence[CameraConfig]) -> list[NDArray[np.uint8]]:
        """The class of each pixel of `images`, (H, W) each, as numbers of `datatypes.Semantic`."""
        ...

    def labels_at(self, mount: CameraConfig) -> Affordances:
        """The affordances of a car that stands where this camera looks from."""
        ...

    def other_commands_at(self, mount: CameraConfig) -> list[Alternative]:
        """What the other commands that could be given would ask of such a car."""
        ...


def is_mapped(world: World) -> TypeGuard[MappedWorld]:
    """Whether a world's map and route are known (asked without reading them, as there may be no episode yet)."""
    return all(getattr_static(world, name, None) is not None for name in ("roads", "route"))


def is_recordable(world: World) -> TypeGuard[RecordableWorld]:
    """Whether a world can be seen from anywhere on the car."""
    return is_mapped(world) and getattr_static(world, "images", None) is not None


class BadImage(ValueError):  # noqa: N818 (it is the image that is bad)
    """An image tells nothing, or a perception makes nothing of it; the driver should brake."""


class Perception(Protocol):
    """Image to affordances."""

    def reset(self) -> None:
        """Start an episode."""
        ...

    def predict(self, observation: Observation) -> Affordances:
        """The affordances of the newest image. Raises BadImage where it is no use."""
        ...


class Controller(Protocol):
    """Affordances to control."""

    def reset(self) -> None:
        """Start an episode."""
        ...

    def step(self, affordances: Affordances, speed: float, command: Command) -> Decision:
        """The control for the next step, with its reasons; speed in m/s."""
        ...


class Agent(Protocol):
    """A driver. It may also have an attribute `decision`, the reasons for the last control (a `Decision` or None), and
    its class `camera`, the camera that it wants (a `CameraConfig`, or None where it looks at no image). A driver that
    has nothing to forget may leave `reset` out."""

    def reset(self) -> None:
        """Start an episode."""
        ...

    def act(self, observation: Observation) -> Control:
        """The control for this observation."""
        ...
