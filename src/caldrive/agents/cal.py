"""The CAL agent: perception turns the observation into affordances, the controller turns them into control (Fig. 2)."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from caldrive.datatypes import Affordances, Control, Decision, Observation
from caldrive.interfaces import BadImage, Controller, Perception, TruthSource

UNKNOWN = Affordances(  # what an image tells that is no use
    hazard_stop=math.nan, red_light=math.nan, speed_sign=None, vehicle_distance=math.nan, relative_angle=math.nan,
    center_distance=math.nan,
)  # fmt: skip


class CALAgent:
    """Perception + controller (`interfaces.Agent`). Both may be your own.

    decision: the reasons for the last control, None before the first.
    """

    def __init__(self, perception: Perception, controller: Controller) -> None:
        self.perception, self.controller = perception, controller
        self.decision: Decision | None = None

    def reset(self) -> None:
        """Start an episode. A controller without a method reset has nothing to forget."""
        self.perception.reset()
        if (reset := getattr(self.controller, "reset", None)) is not None:
            reset()
        self.decision = None

    def act(self, observation: Observation) -> Control:
        """The control for this observation; where its image is no use, the brake, and the reason in the note.

        Raises TypeError where the controller returns something else than a Decision.
        """
        affordances, note = self._see(observation)
        decision: Any = self.controller.step(affordances, observation.speed, observation.command)
        if not isinstance(decision, Decision) or not isinstance(decision.control, Control):
            name = type(self.controller).__name__
            raise TypeError(f"the controller {name} returned {decision!r}, wanted a Decision with a Control")
        self.decision = replace(decision, note=note or decision.note)
        return decision.control

    def _see(self, observation: Observation) -> tuple[Affordances, str]:
        """The affordances, or UNKNOWN and why."""
        try:
            return self.perception.predict(observation), ""
        except BadImage as error:
            return UNKNOWN, str(error)


class OraclePerception:
    """Perception that knows the truth: the data collector, and the upper bound of every table.

    truth_source: gives the truth of the present step, for instance a world's `truth`.
    """

    def __init__(self, truth_source: TruthSource) -> None:
        self.truth_source = truth_source

    def reset(self) -> None:
        """Nothing to forget."""

    def predict(self, observation: Observation) -> Affordances:
        """The true affordances, whatever the image shows."""
        return self.truth_source().affordances
