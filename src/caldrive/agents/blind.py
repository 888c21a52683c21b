"""A driver without one of its senses: an affordance is held at its default, whatever is seen. What happens then says
what the affordance is worth, and whether a town punishes inattention."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from caldrive.affordances import BY_NAME
from caldrive.datatypes import Affordances, Observation
from caldrive.interfaces import Agent, Perception

DEFAULTS = Affordances()  # nobody ahead, no light, no sign, straight on in the middle of the lane


class BlindPerception:
    """A perception that does not see some affordances (`interfaces.Perception`)."""

    def __init__(self, perception: Perception, blind: Sequence[str]) -> None:
        self.perception = perception
        self._unseen = {name: getattr(DEFAULTS, name) for name in blind}

    def reset(self) -> None:
        """Start an episode."""
        self.perception.reset()

    def predict(self, observation: Observation) -> Affordances:
        """What the perception sees, but for these."""
        return replace(self.perception.predict(observation), **self._unseen)


def blinded(agent: Agent, blind: Sequence[str]) -> Agent:
    """The agent, which from now on does not see these affordances. Raises ValueError for one that there is not, and for
    an agent without an attribute `perception` (`interfaces.Perception`)."""
    require_affordances(blind)
    if not blind:
        return agent
    perception: Any = getattr(agent, "perception", None)
    if not callable(getattr(perception, "predict", None)):
        raise ValueError(
            f"found that {type(agent).__name__} has no perception that could be blind, wanted an attribute "
            "`perception` with a method predict: add it, or leave --blind out"
        )
    agent.perception = BlindPerception(perception, blind)  # type: ignore[attr-defined]
    return agent


def require_affordances(names: Sequence[str]) -> None:
    """Raises ValueError for an affordance that there is not."""
    if unknown := [name for name in names if name not in BY_NAME]:
        raise ValueError(
            f"found affordance {unknown[0]!r}, wanted one of {', '.join(BY_NAME)}: type --blind hazard_stop"
        )
