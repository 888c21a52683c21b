"""The three seams of caldrive: a world to drive in, a perception that looks, an agent that acts."""

from __future__ import annotations

from typing import Protocol

from caldrive.datatypes import Affordances, Control, Decision, Observation, Scenario, Truth


class World(Protocol):
    """A place to drive. dt: seconds of one step."""

    dt: float

    def reset(self, scenario: Scenario) -> Observation: ...
    def step(self, control: Control) -> Observation: ...
    def truth(self) -> Truth: ...
    def close(self) -> None: ...


class BadImage(ValueError):  # noqa: N818 (it is the image that is bad)
    """An image tells nothing, or a perception makes nothing of it; the driver should brake."""


class Perception(Protocol):
    """Image to affordances. reset() starts an episode; predict raises BadImage where the image is no use."""

    def reset(self) -> None: ...
    def predict(self, observation: Observation) -> Affordances: ...


class Agent(Protocol):
    """A driver. decision holds the reasons for the last control, where the agent has any."""

    decision: Decision | None

    def reset(self) -> None: ...
    def act(self, observation: Observation) -> Control: ...
