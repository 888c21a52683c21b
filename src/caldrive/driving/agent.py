"""The CAL agent: perception turns the observation into affordances, the controller turns them into control (Fig. 2)."""

from __future__ import annotations

from collections.abc import Callable

from caldrive.control.controller import Controller
from caldrive.datatypes import Affordances, Control, Decision, Observation, Perception, Truth


class CALAgent:
    """Perception + controller. decision: the reasons for the last control, None before the first."""

    def __init__(self, perception: Perception, controller: Controller) -> None:
        self.perception, self.controller = perception, controller
        self.decision: Decision | None = None

    def reset(self) -> None:
        """Start an episode."""
        self.perception.reset()
        self.controller.reset()
        self.decision = None

    def act(self, observation: Observation) -> Control:
        """The control for this observation."""
        affordances = self.perception.predict(observation)
        self.decision = self.controller.step(affordances, observation.speed, observation.command)
        return self.decision.control


class OraclePerception:
    """Perception that knows the truth: the data collector, and the upper bound of every table.

    truth_source: gives the truth of the moment, for instance a world's `truth`.
    """

    def __init__(self, truth_source: Callable[[], Truth]) -> None:
        self.truth_source = truth_source

    def reset(self) -> None:
        """Nothing to forget."""

    def predict(self, observation: Observation) -> Affordances:
        """The true affordances, whatever the image shows."""
        return self.truth_source().affordances
