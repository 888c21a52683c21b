"""The CAL agent: perception turns the observation into affordances, the controller turns them into control (Fig. 2)."""

from __future__ import annotations

import math
from dataclasses import replace

from caldrive.datatypes import Affordances, Control, Decision, Observation
from caldrive.interfaces import BadImage, Controller, Perception, TruthSource

NOTHING = Affordances(*(math.nan,) * 2, None, *(math.nan,) * 3)  # what an image tells that is no use


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
        """The control for this observation; where its image is no use, the brake, and the reason in the note."""
        affordances, note = self._see(observation)
        decision = self.controller.step(affordances, observation.speed, observation.command)
        self.decision = replace(decision, note=note or decision.note)
        return self.decision.control

    def _see(self, observation: Observation) -> tuple[Affordances, str]:
        """The affordances, or nothing and why."""
        try:
            return self.perception.predict(observation), ""
        except BadImage as error:
            return NOTHING, str(error)


class OraclePerception:
    """Perception that knows the truth: the data collector, and the upper bound of every table.

    truth_source: gives the truth of the moment, for instance a world's `truth`.
    """

    def __init__(self, truth_source: TruthSource) -> None:
        self.truth_source = truth_source

    def reset(self) -> None:
        """Nothing to forget."""

    def predict(self, observation: Observation) -> Affordances:
        """The true affordances, whatever the image shows."""
        return self.truth_source().affordances
